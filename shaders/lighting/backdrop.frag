// The environment behind all surfaces. Blending shows it where the picture is not covered.
#include <pass_view.glsl>

#ifdef BLURRED
uniform float backdrop_blur;
#endif
in vec2 v_uv;
out vec4 radiance;
#ifdef WRITES_DIFFUSE
out vec4 diffuse;
#endif

void main() {
    View view = PASS_VIEW;
    vec4 view_position = view.inverse_projection * vec4(v_uv * 2.0 - 1.0, 0.5, 1.0);
    vec3 ray = view.eye.w > 0.0 ? view_position.xyz / view_position.w : vec3(0.0, 0.0, -1.0);
    vec3 direction = normalize(mat3(view.inverse_view) * ray);
#ifdef BLURRED
    float lobe = clamp(backdrop_blur, 0.0, 1.0);
#else
    float lobe = -max(max(length(dFdx(direction)), length(dFdy(direction))), 1e-6);
#endif
    radiance = vec4(light_from(direction, lobe), 0.0);
#ifdef WRITES_DIFFUSE
    diffuse = radiance;
#endif
}
