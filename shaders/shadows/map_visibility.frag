// Screen-space visibility of one light: `shadow()` at the positions of a depth texture.
#include <depth_surface.glsl>

out vec4 visibility;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float window_depth;
    vec3 position = position_at(texel, TEXEL_CENTER, window_depth);
    visibility = vec4(1.0);
    if (is_nothing(window_depth)) return;
    visibility = vec4(shadow(LIGHT, position, geometric_normal_at(texel, TEXEL_CENTER, position, window_depth)));
}
