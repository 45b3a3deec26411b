// The backdrop behind all surfaces: the environment, or the background if there is none, with the air in front of it.
// Blending shows it where the picture is not covered.
#include <pass_view.glsl>
#include <air.glsl>

#ifdef HAS_ENVIRONMENT
#ifdef BLURRED
uniform float backdrop_blur;
#endif
#else
uniform vec3 background;
#endif
in vec2 v_uv;
out vec4 radiance;
#ifdef WRITES_DIFFUSE
out vec4 diffuse;
#endif

const float AIR_DISTANCE = 1e5;  // metres of air in front of the background

void main() {
    View view = PASS_VIEW;
    vec4 view_position = view.inverse_projection * vec4(v_uv * 2.0 - 1.0, 0.5, 1.0);
    vec3 ray = view.eye.w > 0.0 ? view_position.xyz / view_position.w : vec3(0.0, 0.0, -1.0);
    vec3 direction = normalize(mat3(view.inverse_view) * ray);
#ifdef HAS_ENVIRONMENT
#ifdef BLURRED
    float lobe = clamp(backdrop_blur, 0.0, 1.0);
#else
    float lobe = -max(max(length(dFdx(direction)), length(dFdy(direction))), 1e-6);
#endif
    radiance = vec4(light_from(direction, lobe), 0.0);
#else
    radiance = vec4(background, 0.0);
#endif
#ifdef WRITES_DIFFUSE
    diffuse = radiance;
#endif
#ifdef HAS_AIR
    vec3 begin = view.eye.w > 0.0 ? vec3(0.0) : view_position.xyz / view_position.w;
    begin = (view.inverse_view * vec4(begin, 1.0)).xyz;
    radiance.rgb = through_air(begin + direction * AIR_DISTANCE, radiance.rgb);
#endif
}
