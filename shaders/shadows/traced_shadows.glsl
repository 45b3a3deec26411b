// Visibility of a light, from rays to it: one ray for a light without a size, otherwise rays to points on a disc that
// faces the shaded point.
#include <frame.glsl>
#include <lights.glsl>
#include <ray_directions.glsl>
#include <trace.glsl>

// A step may trace a part of the rays: their sum over all steps is the visibility.
#ifdef FIRST_RAY
const int FIRST = FIRST_RAY, PAST = PAST_RAY;
#else
const int FIRST = 0, PAST = SAMPLES;
#endif

uniform sampler2D casters;  // 1 for each light whose shadows are traced
uniform float size;         // diameter of point and spot lights, metres
uniform float angle;        // angular diameter of directional lights, radians

float shadow(int light, vec3 position, vec3 normal) {
#if LIGHT_COUNT > 0
    if (texelFetch(casters, ivec2(light, 0), 0).r < 0.5) return FIRST == 0 ? 1.0 : 0.0;
    vec4 source = lights[light].position;
    vec3 to_light = source.xyz - position * source.w;
    float distance = length(to_light);
    vec3 axis = to_light / max(distance, 1e-12);
    if (dot(axis, normal) <= 0.0) return 0.0;  // the light is behind the surface

    float spread = source.w == 0.0 ? tan(0.5 * angle) : 0.5 * size / max(distance, 1e-12);
    float offset = ray_offset(position, (camera.view * vec4(position, 1.0)).z);
    vec3 origin = position + normal * offset;
    float farthest = source.w == 0.0 ? 1e30 : distance - offset;
    vec3 tangent = any_tangent(axis), bitangent = cross(axis, tangent);
    int count = spread > 0.0 ? SAMPLES : 1, past = min(count, PAST);
    vec2 shift = random_shift(ivec2(gl_FragCoord.xy), ANIMATED * frame_index);
    float lit = 0.0;
    for (int i = FIRST; i < past; ++i) {
        vec2 disc = spread * point_on_disc(shifted_point(i, shift));
        vec3 ray = axis + tangent * disc.x + bitangent * disc.y;
        float stretch = length(ray);
        ray /= stretch;
        if (dot(ray, normal) > 0.0 && !any_hit(origin, ray, 0.0, farthest * stretch)) lit += 1.0;
    }
    return lit / float(count);
#else
    return FIRST == 0 ? 1.0 : 0.0;
#endif
}
