// Diffuse light from other surfaces, by ray tracing. A ray that hits a surface within the radius receives the diffuse
// light that leaves it: emission, and reflected light of the lights, the sky and further bounces.
#define SCENE_LAYERS
#define PASSES_LIGHT
#define DIFFUSE_LOBE 0
#define DIFFUSE_LOBE_SHARED 1
#undef SCENE_ANY_SHEEN  // sheen darkens the layers below by a few percent, and would need a table
#include <depth_surface.glsl>
#include <frame.glsl>
#include <layers.glsl>
#include <traced_light.glsl>
#include "surfaces.glsl"
#include "traced_origin.glsl"
#include "outputs.glsl"
#ifdef HAS_MAP
#include <environment.glsl>
#include <equirectangular.glsl>
uniform sampler2D map;
#endif

uniform sampler2D normal;    // world space
uniform ivec2 reduced_size;  // of the target
uniform float radius;        // metres; with WIDER that of occlusion, and light comes from `wider` times as far
#ifdef WIDER
uniform float wider;
#endif
uniform vec3 sky;            // radiance from all sides, without an environment
uniform int first_sample;
#if REUSE
uniform sampler2D diffuse;  // radiance without specular light, of the picture's surfaces

// Whether the picture shows the surface `s`; then `light` is its diffuse radiance there.
bool is_shown(Surface s, out vec3 light) {
    vec4 clip = depth_views[0].view_projection * vec4(s.position, 1.0);
    vec2 uv = clip.xy / clip.w * 0.5 + 0.5;
    ivec2 size = textureSize(depth, 0), texel = clamp(ivec2(floor(uv * vec2(size))), ivec2(0), size - 1);
    float window_depth;
    vec3 shown = position_at(texel, TEXEL_CENTER, window_depth);
    light = texelFetch(diffuse, texel, 0).rgb;
    vec3 to_viewer = view_dir(depth_views[0], s.position);
    // The texel's centre lies on the surface's plane, up to an error that grows with the distance.
    float tolerance = 2e-3 * linear_depth(depth_views[0], window_depth);
    return clip.w > 0.0 && uv == clamp(uv, 0.0, 1.0) && !is_nothing(window_depth)
        && dot(s.geometric_normal, to_viewer) > 0.05 && abs(dot(shown - s.position, s.geometric_normal)) < tolerance
        && dot(texelFetch(normal, texel, 0).xyz, s.normal) > 0.9
        && distance(shown, s.position) < 0.05 * linear_depth(depth_views[0], window_depth);
}
#endif

const float SKY_ANGLE = 0.02;  // radians by which the environment is blurred, so that a small sun causes less noise

// Radiance that arrives along a ray that hits nothing.
vec3 sky_radiance(vec3 direction) {
#ifdef HAS_MAP
    return equirectangular_radiance(map, world_to_environment(direction), SKY_ANGLE) * environment_transform.z;
#else
    return sky;
#endif
}

bool has_sky() {
#ifdef HAS_MAP
    return true;
#else
    return sky != vec3(0.0);
#endif
}

// Fraction of diffuse light, from this direction and to the viewer, that passes through the coat.
float below_coat(Surface s, vec3 light_dir) {
#ifdef CLEARCOAT_LAYER
    return below_clearcoat(s, light_dir);
#else
    return 1.0;
#endif
}

// Diffuse radiance that arrives along a ray from a surface. w is 1 if the ray hits nothing within the radius of
// occlusion.
vec4 arriving_light(vec3 origin, vec3 direction, ivec2 pixel, int seed) {
    vec4 light = vec4(0.0);
    vec3 throughput = vec3(1.0);
    bool is_sky_known = false;  // the light at the last surface already includes the sky
#ifdef WIDER
    float farthest = radius * wider;
#else
    float farthest = radius;
#endif
    for (int bounce = 1; bounce <= BOUNCES + 1; ++bounce) {
        Hit hit;
        Surface s;
        ++seed;
        if (!stopping_surface(origin, direction, farthest, pixel, seed, throughput, hit, s)) {
            // The lighting node already adds the sky that the pixel itself sees.
            if (bounce == 1) light.w = 1.0;
            else if (!is_sky_known) light.rgb += throughput * sky_radiance(direction);
            break;
        }
        if (bounce == 1 && hit.distance > radius) light.w = 1.0;
        if (bounce > BOUNCES) break;
        origin = s.position + s.geometric_normal * ray_offset(s.position, hit.distance);
        is_sky_known = false;
#if REUSE
        vec3 known;
        is_sky_known = is_shown(s, known);
        if (is_sky_known) light.rgb += throughput * known;
#endif
        if (!is_sky_known) light.rgb += throughput * emitted_radiance(hit, s);
        throughput *= s.lit * s.diffuse;
        if (!is_sky_known) {
            vec3 light_dir;
            vec3 irradiance = irradiance_from_one_light(s, origin, random_shift(pixel + 16384, seed).x, light_dir);
            light.rgb += throughput * irradiance * (max(dot(s.normal, light_dir), 0.0) * below_coat(s, light_dir) / PI);
        }
        if (throughput == vec3(0.0) || (bounce == BOUNCES && (is_sky_known || !has_sky()))) break;
        direction = cosine_direction(s.normal, random_shift(pixel + 32768, seed));
        if (dot(direction, s.geometric_normal) <= 0.0) break;
        throughput *= below_coat(s, direction);
        farthest = 1e30;
    }
    return light;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 texel = screen_texel(pixel, reduced_size, textureSize(depth, 0));
    float window_depth;
    vec3 position = position_at(texel, TEXEL_CENTER, window_depth);
    if (is_nothing(window_depth)) {
        write_outputs(first_sample == 0 ? OPEN_VALUE : Value(0.0));
        return;
    }
    vec3 axis = normalize(texelFetch(normal, texel, 0).xyz);
    vec3 origin = ray_origin(texel, position, axis, window_depth);
    int frame = ANIMATED * frame_index;
    vec2 shift = random_shift(pixel, frame);
    Value sum = Value(0.0);
    for (int i = first_sample; i < first_sample + PASS_RAYS; ++i) {
        int seed = (frame * SAMPLES + i) * (BOUNCES + 2);
        sum += arriving_light(origin, cosine_direction(axis, shifted_point(i, shift)), pixel, seed);
    }
    write_outputs(min(sum / float(SAMPLES), 65504.0));
}
