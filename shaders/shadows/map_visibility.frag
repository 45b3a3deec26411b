// One light's visibility in screen space: `shadow()` at the positions that the depth texture holds.
#include <depth_surface.glsl>

out vec4 visibility;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float d;
    vec3 position = position_at(texel, TEXEL_CENTER, d);
    visibility = vec4(1.0);
    if (is_nothing(d)) return;
    visibility = vec4(shadow(LIGHT, position, geometric_normal_at(texel, TEXEL_CENTER, position, d)));
}
