// A point over each tile that is listed. One that reaches out of the picture has its middle inside: else it is clipped.
uniform ivec2 screen;
struct Command {
    uint vertices, instances, first, base_instance, none;
};
layout(std430) readonly buffer tiles {
    Command commands[2];
    uint listed[];
};

void main() {
    int number = int(listed[gl_VertexID]), columns = (screen.x + TILE - 1) / TILE;
    vec2 middle = min(vec2(number % columns, number / columns) * TILE + 0.5 * TILE, vec2(screen) - 0.5);
    gl_Position = vec4(middle / vec2(screen) * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = float(TILE);
}
