// Radiance in the specular lobe of the picture's surfaces, from rays in directions of the lobe.
#define SCENE_LAYERS
#define PASSES_LIGHT
#include <brdf.glsl>
#include <brdf_table.glsl>
#include <depth_surface.glsl>
#include <frame.glsl>
#include <layered_light.glsl>
#include <radiance.glsl>
#include <sampled_directions.glsl>
#include <traced_light.glsl>
#if defined(SCENE_ANY_SHADOW_CATCHER) && defined(HAS_ENVIRONMENT)
#include <shadow_catcher.glsl>
#endif

uniform ivec2 reduced_size;  // of the target
uniform float max_roughness;
uniform int first_sample;
out vec4 traced;

// Confidence in the reflections of a surface: 1 for smooth ones, falling to 0 at `max_roughness`.
float confidence_at(float roughness) {
    if (max_roughness >= 1.0) return 1.0;
    return clamp(4.0 * (max_roughness - roughness) / max(max_roughness, 1e-6), 0.0, 1.0);
}

// Radiance that arrives at `origin` from a direction. If the ray hits nothing, it is that of the environment, blurred
// by `angle`.
vec3 arriving_radiance(vec3 origin, vec3 direction, float angle, ivec2 pixel, int seed) {
    Hit hit;
    Surface s;
    vec3 throughput = vec3(1.0);
    if (!stopping_surface(origin, direction, 1e30, pixel, seed, throughput, hit, s)) {
#ifdef HAS_ENVIRONMENT
        return throughput * light_from(direction, -angle);
#else
        return throughput * ambient;
#endif
    }
    if (s.lit == 0.0) return throughput * unlit_radiance(s);
    s.emissive = emitted_radiance(hit, s);
#if defined(SCENE_ANY_SHADOW_CATCHER) && defined(HAS_ENVIRONMENT)
    if (scene_has(hit.instance, SCENE_SHADOW_CATCHER)) {
        vec3 shown = light_from(caught_direction(s.position, direction), -angle);
        catch_shadows(s, shown, unshadowed_light(s, light_from(s.normal, 2.0)));
    }
#endif
    vec3 leaving = s.position + s.geometric_normal * ray_offset(s.position, hit.distance), light_dir;
    vec3 irradiance = irradiance_from_one_light(s, leaving, random_shift(pixel + 16384, seed).x, light_dir);
    ReflectedLight reflectance = shade(s, light_dir);
#ifdef HAS_LAYERS
    reflectance = layered_light(s, light_dir, reflectance);
#endif
    ReflectedLight direct = ReflectedLight(reflectance.diffuse * irradiance, reflectance.specular * irradiance);
    return throughput * radiance_of(s, direct, environment_lighting(s));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    // The texel of the screen that a texel of a reduced target stands for, as in `upsample.frag`.
    vec2 size = vec2(reduced_size), step = vec2(textureSize(depth, 0)) / size;
    ivec2 texel = ivec2((vec2(pixel) + 0.5) * step + 0.25 / size);
    float window_depth;
    vec3 position = position_at(texel, TEXEL_CENTER, window_depth);
    traced = vec4(0.0);
    if (is_nothing(window_depth)) return;

    // The surface itself, by a short ray around the position.
    vec3 viewer = view_dir(depth_views[0], position);
    float distance = linear_depth(depth_views[0], window_depth);
    float margin = 10.0 * ray_offset(position, distance);
    Hit hit;
    if (!visible_hit(position + margin * viewer, -viewer, 0.0, 2.0 * margin, hit)) return;
    Surface s = scene_surface(hit.instance, hit.triangle, hit.barycentrics, viewer);
    float confidence = confidence_at(s.roughness) * s.lit;
    if (confidence == 0.0) return;

    vec2 alpha = vec2(s.roughness * s.roughness);
    mat3 frame = tangent_frame_of(s.normal);
#ifdef NEEDS_GRAIN
    if (s.anisotropy > 0.0) {
        frame = mat3(s.tangent, s.bitangent, s.normal);
        alpha.x = mix(alpha.x, 1.0, s.anisotropy * s.anisotropy);
    }
#endif
    vec3 v = viewer * frame;
    v.z = max(v.z, 1e-4);
    v = normalize(v);
    float masking = length(vec3(alpha * v.xy, v.z));
    vec3 origin = s.position + s.geometric_normal * ray_offset(s.position, distance);
    int animation = ANIMATED * frame_index;
    vec2 shift = random_shift(pixel, animation);
    vec3 sum = vec3(0.0);
    for (int i = first_sample; i < first_sample + PASS_RAYS; ++i) {
        vec3 h = sample_visible_normal(v, alpha, shifted_point(i, shift));
        vec3 l = reflect(-v, h), direction = frame * l;
        if (l.z <= 0.0 || dot(direction, s.geometric_normal) <= 0.0) continue;
        // Height-correlated Smith G2 / G1: with F, all that remains of BRDF × cosine / density.
        float shadowing = length(vec3(alpha * l.xy, l.z));
        float weight = l.z * (v.z + masking) / (l.z * masking + v.z * shadowing);
        vec3 fresnel = fresnel_schlick(s.f0, s.f90, max(dot(v, h), 0.0));
        float angle = 1e-3 + 0.25 * min(alpha.x, alpha.y);
        int seed = animation * SAMPLES + i;
        sum += fresnel * weight * min(arriving_radiance(origin, direction, angle, pixel, seed), MAX_HALF_FLOAT);
    }
    // Lighting multiplies by the lobe's albedo.
    vec2 brdf = textureLod(brdf_table, vec2(sqrt(v.z), s.roughness), 0.0).xy;
    sum /= max(s.f0 * brdf.x + s.f90 * brdf.y, 1e-4) * float(SAMPLES);
    traced = vec4(min(sum, MAX_HALF_FLOAT), confidence * float(PASS_RAYS) / float(SAMPLES));
}
