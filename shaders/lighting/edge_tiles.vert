// A point sprite over each listed tile. The centre of a tile that reaches beyond the picture is moved inside, because
// points whose centre is outside are clipped.
uniform ivec2 screen;
struct Command {
    uint vertices, instances, first, base_instance, padding;
};
layout(std430) readonly buffer tiles {
    Command commands[2];
    uint tile_indices[];
};

void main() {
    int tile = int(tile_indices[gl_VertexID]), columns = (screen.x + TILE - 1) / TILE;
    vec2 center = min(vec2(tile % columns, tile / columns) * TILE + 0.5 * TILE, vec2(screen) - 0.5);
    gl_Position = vec4(center / vec2(screen) * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = float(TILE);
}
