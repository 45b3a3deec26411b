// A line's colour, its edge smoothed over a pixel.
uniform float width;    // pixels
uniform float through;  // opacity of what is behind something
flat in vec3 v_tint;
noperspective in float v_across;
out vec4 color;

void main() {
    float covered = clamp(0.5 * width + 0.5 - abs(v_across), 0.0, 1.0);
#if HIDDEN
    covered *= through;
#endif
    color = vec4(v_tint, covered);
}
