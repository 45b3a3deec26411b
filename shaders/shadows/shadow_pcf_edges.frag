// The least and the largest depth in a tile of a shadow map and around it as far as a kernel reaches. A receiver in
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
    edges = vec2(1.0, 0.0);
    for (int y = first.y; y < last.y; y += 2) {
        for (int x = first.x; x < last.x; x += 2) {
            vec4 four = textureGather(shadow_map, (vec2(x, y) + 1.0) / vec2(size));
            vec2 low_two = min(four.xy, four.zw);
            vec2 high_two = max(four.xy, four.zw);
            edges = vec2(min(edges.x, min(low_two.x, low_two.y)), max(edges.y, max(high_two.x, high_two.y)));
        }
    }
}
