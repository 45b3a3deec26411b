// Expands lines to strips of constant width on the screen, clipped in front of the eye.
#include <pass_view.glsl>

layout(lines) in;
layout(triangle_strip, max_vertices = 4) out;
flat in vec3 g_tint[];
flat out vec3 v_tint;
noperspective out float v_offset;  // pixels from the centre line

uniform float width;  // pixels

void main() {
    vec4 a = gl_in[0].gl_Position, b = gl_in[1].gl_Position;
    const float MIN_W = 1e-3;  // metres in perspective views; orthographic ones have w = 1
    if (max(a.w, b.w) < MIN_W || a == b) return;
    if (a.w < MIN_W) a = mix(a, b, (MIN_W - a.w) / (b.w - a.w));
    if (b.w < MIN_W) b = mix(b, a, (MIN_W - b.w) / (a.w - b.w));
    vec2 ndc_to_pixels = 0.5 * PASS_VIEW.viewport.xy;
    vec2 direction = (b.xy / b.w - a.xy / a.w) * ndc_to_pixels;
    if (dot(direction, direction) == 0.0) return;
    direction = normalize(direction);
    float half_width = 0.5 * width + 0.5;
    for (int i = 0; i < 4; ++i) {
        vec4 end = i < 2 ? a : b;
        float offset = (i & 1) == 0 ? -half_width : half_width;
        v_tint = g_tint[0];
        v_offset = offset;
        gl_Position = end + vec4(vec2(-direction.y, direction.x) * offset / ndc_to_pixels * end.w, 0.0, 0.0);
        EmitVertex();
    }
}
