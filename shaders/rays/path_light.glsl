// The light that paths collect: which part of it is wanted, and what a surface reflects.
#include <layered_light.glsl>
#include <lights.glsl>
#include <luminance.glsl>
#include <math.glsl>
#include <shading.glsl>

#ifndef HAS_SAMPLED_DIRECTIONS
#include <sampled_directions.glsl>

vec3 sample_direction(Surface s, vec3 xi) {
    return tangent_frame_of(s.normal) * sample_cosine(xi.xy);
}

float direction_density(Surface s, vec3 light_dir) {
    return max(dot(s.normal, light_dir), 0.0) / PI;
}
#endif

// The empirical models reflect `kd` of the irradiance of a light, without 1/π. Light from all sides is divided by π, as
// it is in geometry passes, so that a surface reflects no more than it receives.
#ifdef NEEDS_PHONG
#define SPREAD_LIGHT (1.0 / PI)
#else
#define SPREAD_LIGHT 1.0
#endif

#if LIGHT_PART == LIGHT_PART_DIRECT
#define LAST_VERTEX 0
#elif LIGHT_PART == LIGHT_PART_ONE_BOUNCE
#define LAST_VERTEX min(1, MAX_BOUNCES)
#else
#define LAST_VERTEX MAX_BOUNCES
#endif
#if SOURCES == SOURCES_ALL || SOURCES == SOURCES_ENVIRONMENT
#define USES_SKY
#if defined(HAS_ENVIRONMENT)
#define USES_ENVIRONMENT
#endif
#endif
#if (SOURCES == SOURCES_ALL || SOURCES == SOURCES_LIGHTS) && LIGHT_COUNT > 0 && !defined(NEEDS_NOTHING)
#define USES_LIGHTS
#endif
#if SOURCES == SOURCES_ALL || SOURCES == SOURCES_EMISSIVE
#define USES_EMISSION
#endif

// Whether light that is reflected `bounces` times between its first and its last surface belongs to the picture.
bool is_wanted(int bounces) {
#if LIGHT_PART == LIGHT_PART_DIRECT
    return bounces <= 0;
#elif LIGHT_PART == LIGHT_PART_ONE_BOUNCE
    return bounces == 1;
#elif LIGHT_PART == LIGHT_PART_INDIRECT
    return bounces >= 1;
#else
    return true;
#endif
}

float power_heuristic(float density, float other) {
    float ratio = other / max(density, 1e-37);  // squares of densities would overflow
    return 1.0 / (1.0 + ratio * ratio);
}

vec3 reflected_part(Surface s, vec3 light_dir) {
    ReflectedLight found = shade(s, light_dir);
#ifdef HAS_LAYERS
    found = layered_light(s, light_dir, found);
#endif
#if TERMS == TERMS_DIFFUSE
    return found.diffuse;
#elif TERMS == TERMS_SPECULAR
    return found.specular;
#else
    return found.diffuse + found.specular;
#endif
}

// One punctual light, chosen in proportion to its unshadowed light at the surface. `sum` is that of all lights.
int choose_light(Surface s, float xi, out float chance, out float sum) {
    int light = -1;
    sum = 0.0;
    chance = 0.0;
#ifdef USES_LIGHTS
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 to_light;
        vec3 irradiance = irradiance_from(lights[i], s.position, to_light);
        bool is_lit = dot(s.geometric_normal, to_light) > 0.0;
        float cosine = dot(s.normal, to_light);
#ifdef TRANSMISSION_LAYER
        if (s.transmission > 0.0) {  // thin walls are lit from behind, too
            is_lit = is_lit || s.thickness == 0.0;
            cosine = abs(cosine);
        }
#endif
        float weight = is_lit ? luminance_of(irradiance) * max(cosine, 0.05) : 0.0;
        sum += weight;
        float share = sum > 0.0 ? weight / sum : 0.0;
        bool takes = xi < share;
        xi = takes ? xi / max(share, 1e-7) : (xi - share) / max(1.0 - share, 1e-7);
        light = takes ? i : light;
        chance = takes ? weight : chance;
    }
    chance /= max(sum, 1e-37);
#endif
    return light;
}
