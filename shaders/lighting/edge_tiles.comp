// Lists the tiles that contain edges, in two draw commands: all of them, and those with a shadow edge, where the first
// sample has not been shaded yet.
layout(local_size_x = 8, local_size_y = 8) in;
uniform sampler2D edges;
#ifdef HAS_SHADOW_DIFFERENCE
uniform sampler2DMS shadow_difference;  // 1 where samples see different surfaces
#endif
struct Command {
    uint vertices, instances, first, base_instance, padding;
};
layout(std430) buffer tiles {
    Command commands[2];
    uint tile_indices[];  // for each command as many as there are tiles
};

void append(int command, uint tile_count, uint tile) {
    uint index = atomicAdd(commands[command].vertices, 1u);
    tile_indices[tile_count * command + index] = tile;
}

void main() {
    ivec2 tile = ivec2(gl_GlobalInvocationID.xy), size = textureSize(edges, 0);
    ivec2 grid = (size + TILE - 1) / TILE;
    if (any(greaterThanEqual(tile, grid))) return;
    uint tile_count = uint(grid.x * grid.y), tile_index = uint(tile.y * grid.x + tile.x);
    if (tile_index == 0u) {
        commands[0].instances = commands[1].instances = 1u;
        commands[1].first = tile_count;
    }
    bool has_edge = false, has_shadow_edge = false;
    ivec2 end = min((tile + 1) * TILE, size);
    for (int y = tile.y * TILE; y < end.y; ++y) {
        for (int x = tile.x * TILE; x < end.x; ++x) {
            if (texelFetch(edges, ivec2(x, y), 0).r < 0.5) continue;
            has_edge = true;
#ifdef HAS_SHADOW_DIFFERENCE
            if (texelFetch(shadow_difference, ivec2(x, y), 0).r < 1.0) has_shadow_edge = true;
#endif
        }
    }
    if (has_edge) append(0, tile_count, tile_index);
    if (has_shadow_edge) append(1, tile_count, tile_index);
}
