// Draws of the tiles that hold a mark: of all of them, and of those where a mark is a shadow's, whose first sample has
// not been lit yet.
layout(local_size_x = 8, local_size_y = 8) in;
uniform sampler2D edges;
#ifdef HAS_SHADOW_DIFFERENCE
uniform sampler2DMS shadow_difference;  // 1 where surfaces differ
#endif
struct Command {
    uint vertices, instances, first, base_instance, none;
};
layout(std430) buffer tiles {
    Command commands[2];
    uint listed[];  // for each command as many as there are tiles
};

void list(int command, uint number, uint tile) {
    uint place = atomicAdd(commands[command].vertices, 1u);
    listed[number * command + place] = tile;
}

void main() {
    ivec2 tile = ivec2(gl_GlobalInvocationID.xy), size = textureSize(edges, 0);
    ivec2 count = (size + TILE - 1) / TILE;
    if (any(greaterThanEqual(tile, count))) return;
    uint number = uint(count.x * count.y), own = uint(tile.y * count.x + tile.x);
    if (own == 0u) {
        commands[0].instances = commands[1].instances = 1u;
        commands[1].first = number;
    }
    bool marked = false, shadow = false;
    ivec2 end = min((tile + 1) * TILE, size);
    for (int y = tile.y * TILE; y < end.y; ++y) {
        for (int x = tile.x * TILE; x < end.x; ++x) {
            if (texelFetch(edges, ivec2(x, y), 0).r < 0.5) continue;
            marked = true;
#ifdef HAS_SHADOW_DIFFERENCE
            if (texelFetch(shadow_difference, ivec2(x, y), 0).r < 1.0) shadow = true;
#endif
        }
    }
    if (marked) list(0, number, own);
    if (shadow) list(1, number, own);
}
