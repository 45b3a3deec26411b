// Copies texels that a buffer holds, the top row first, into a texture of any format.
layout(std430) readonly buffer texels { vec4 values[]; };
out vec4 color;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 size = ivec2(SIZE_X, SIZE_Y);
    color = values[(size.y - 1 - at.y) * size.x + at.x];
}
