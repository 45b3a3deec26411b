// The nearest and farthest depth in a tile of a shadow map and around it, as far as a kernel reaches. A receiver in
// front of that range passes every test and one behind it fails every test, so only receivers within it need filtering.
uniform sampler2D shadow_map;
uniform vec2 tiles;  // number of tiles
out vec2 depth_ranges;

void main() {
    ivec2 size = textureSize(shadow_map, 0);
    vec2 tile_size = vec2(size) / tiles;
    vec2 corner = floor(gl_FragCoord.xy - 0.5) * tile_size;
    ivec2 first = ivec2(floor(corner)) - REACH;
    ivec2 last = ivec2(ceil(corner + tile_size)) + REACH;
    depth_ranges = vec2(0.0, 1.0);
    for (int y = first.y; y < last.y; y += 2) {
        for (int x = first.x; x < last.x; x += 2) {
            vec4 depths = textureGather(shadow_map, (vec2(x, y) + 1.0) / vec2(size));
            vec2 nearest = max(depths.xy, depths.zw);
            vec2 farthest = min(depths.xy, depths.zw);
            depth_ranges.x = max(depth_ranges.x, max(nearest.x, nearest.y));
            depth_ranges.y = min(depth_ranges.y, min(farthest.x, farthest.y));
        }
    }
}
