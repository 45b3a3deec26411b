// The nearest and the farthest depth in a tile of a shadow map and around it as far as a kernel reaches. A receiver in
// front of all of it passes every test, one behind all of it none; only between them is there an edge to filter.
uniform sampler2D shadow_map;
uniform vec2 tiles;  // how many
out vec2 edges;

void main() {
    ivec2 size = textureSize(shadow_map, 0);
    vec2 tile = vec2(size) / tiles;
    vec2 low = floor(gl_FragCoord.xy - 0.5) * tile;
    ivec2 first = ivec2(floor(low)) - REACH;
    ivec2 last = ivec2(ceil(low + tile)) + REACH;
    edges = vec2(0.0, 1.0);
    for (int y = first.y; y < last.y; y += 2) {
        for (int x = first.x; x < last.x; x += 2) {
            vec4 four = textureGather(shadow_map, (vec2(x, y) + 1.0) / vec2(size));
            vec2 near_two = max(four.xy, four.zw);
            vec2 far_two = min(four.xy, four.zw);
            edges = vec2(max(edges.x, max(near_two.x, near_two.y)), min(edges.y, min(far_two.x, far_two.y)));
        }
    }
}
