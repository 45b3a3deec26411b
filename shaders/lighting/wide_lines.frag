// Colour of a line, antialiased over a pixel at its edges.
uniform float width;    // pixels
uniform float through;  // opacity where a surface hides the line
flat in vec3 v_tint;
noperspective in float v_offset;
out vec4 color;

void main() {
    float coverage = clamp(0.5 * width + 0.5 - abs(v_offset), 0.0, 1.0);
#if HIDDEN
    coverage *= through;
#endif
    color = vec4(v_tint, coverage);
}
