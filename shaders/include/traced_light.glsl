// Light on surfaces that rays have hit. The step reads an input of `SceneData` with `rays=True`.
#include <lights.glsl>
#include <luminance.glsl>
#include <passing_light.glsl>
#include <ray_directions.glsl>
#include <trace.glsl>

// The surface that stops light along a ray, up to a distance in metres; false if there is none. Transparent surfaces
// stop it with the probability of their opacity, and transmissive ones let it pass straight through at random.
// `throughput` is multiplied by the fraction of light that passes, over the probability. `pixel` and `seed` determine
// the random numbers.
bool stopping_surface(
    vec3 origin, vec3 direction, float farthest, ivec2 pixel, int seed, inout vec3 throughput, out Hit hit,
    out Surface s) {
    bool is_hit = nearest_hit(origin, direction, 0.0, farthest, hit);
#if defined(SCENE_ANY_BLENDED) || defined(SCENE_ANY_TRANSMISSION)
    bool passes = is_hit;
    while (passes) {
        vec2 xi = random_shift(pixel, seed);
        seed = seed * 747796405 + 1;
        passes = false;
#ifdef SCENE_ANY_BLENDED
        passes = scene_has(hit.instance, SCENE_BLENDED)
            && xi.x >= scene_alpha(hit.instance, hit.triangle, hit.barycentrics);
#endif
#ifdef SCENE_ANY_TRANSMISSION
        if (!passes && scene_has(hit.instance, SCENE_TRANSMITS)) {
            vec3 passed = passing_light(hit);
            float chance = clamp(luminance_of(passed), 0.0, 0.95);
            passes = xi.y < chance;
            throughput *= passes ? passed / chance : vec3(1.0 / (1.0 - chance));
        }
#endif
        if (passes) passes = is_hit = nearest_hit(origin, direction, hit.distance, farthest, hit);
    }
#endif
    // Without a branch, because a function that returns early is costly on processors that run pixels in lockstep.
    s = scene_surface(max(hit.instance, 0), max(hit.triangle, 0), hit.barycentrics, -direction);
    return is_hit;
}

// Radiance that a surface of the scene emits towards `s.view_dir`. Back faces of one-sided materials emit none.
vec3 emitted_radiance(Hit hit, Surface s) {
    bool is_front = dot(scene_geometric_normal(hit.instance, hit.triangle), s.view_dir) >= 0.0;
    bool emits = is_front || scene_has(hit.instance, SCENE_DOUBLE_SIDED);
    return s.lit == 0.0 ? s.base_color : emits ? s.emissive : vec3(0.0);
}

// Irradiance in lux, on a surface that faces the light, from one of the lights, over the probability of choosing it:
// its share of the irradiance of `s` without shadows. `origin` is where the shadow ray begins, `xi` a random number
// from 0 to 1; `light_dir` is the unit vector to the light. 0 if the light is in shadow, or there is none.
vec3 irradiance_from_one_light(Surface s, vec3 origin, float xi, out vec3 light_dir) {
    light_dir = s.normal;
#if LIGHT_COUNT > 0
    vec3 irradiance = vec3(0.0);
    float sum = 0.0, chosen = 0.0, farthest = 0.0;
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 direction;
        vec3 unshadowed = irradiance_from(lights[i], s.position, direction);
        float cosine = dot(direction, s.geometric_normal) > 0.0 ? max(dot(direction, s.normal), 0.0) : 0.0;
        float weight = luminance_of(unshadowed) * cosine;
        sum += weight;
        float chance = weight / max(sum, 1e-37);
        bool takes = weight > 0.0 && xi < chance;
        xi = takes ? xi / chance : (xi - chance) / max(1.0 - chance, 1e-7);
        if (takes) {
            irradiance = unshadowed;
            light_dir = direction;
            chosen = weight;
            farthest = lights[i].position.w == 0.0 ? 1e30 : distance(lights[i].position.xyz, origin);
        }
    }
    if (chosen == 0.0 || any_hit(origin, light_dir, 0.0, farthest)) return vec3(0.0);
    return irradiance * (sum / chosen);
#else
    return vec3(0.0);
#endif
}
