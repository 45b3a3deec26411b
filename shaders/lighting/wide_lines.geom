// Lines as strips of one width on the screen, cut off before the eye.
#include <pass_view.glsl>

layout(lines) in;
layout(triangle_strip, max_vertices = 4) out;
flat in vec3 g_tint[];
flat out vec3 v_tint;
noperspective out float v_across;  // pixels from the middle

uniform float width;  // pixels

void main() {
    vec4 a = gl_in[0].gl_Position, b = gl_in[1].gl_Position;
    const float BEFORE = 1e-3;  // metres of perspective views; others have w = 1
    if (max(a.w, b.w) < BEFORE || a == b) return;
    if (a.w < BEFORE) a = mix(a, b, (BEFORE - a.w) / (b.w - a.w));
    if (b.w < BEFORE) b = mix(b, a, (BEFORE - b.w) / (a.w - b.w));
    vec2 pixels = 0.5 * PASS_VIEW.viewport.xy;
    vec2 along = (b.xy / b.w - a.xy / a.w) * pixels;
    if (dot(along, along) == 0.0) return;
    along = normalize(along);
    float reach = 0.5 * width + 0.5;
    for (int i = 0; i < 4; ++i) {
        vec4 end = i < 2 ? a : b;
        float side = (i & 1) == 0 ? -reach : reach;
        v_tint = g_tint[0];
        v_across = side;
        gl_Position = end + vec4(vec2(-along.y, along.x) * side / pixels * end.w, 0.0, 0.0);
        EmitVertex();
    }
}
