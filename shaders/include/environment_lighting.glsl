// Light from all around a surface, of the environment or the constant. `light_from()` is the framework's.
#include <shading.glsl>

uniform vec3 ambient;
#if defined(HAS_ENVIRONMENT) && !defined(NEEDS_PHONG) && !defined(NEEDS_NOTHING)
#define HAS_ENVIRONMENT_SPECULAR
uniform sampler2D brdf_table;  // over the root of N.V and roughness: how much is mirrored, as f0 x + f90 y
#endif

// Where what is mirrored towards the viewer comes from. A grain spreads that across itself: the normal is bent towards
// the one of a cylinder along the grain (Revie 2012), more for a rough surface, as KHR_materials_anisotropy does it.
vec3 reflection_direction(Surface s) {
    vec3 normal = s.normal;
#ifdef NEEDS_GRAIN
    if (s.anisotropy > 0.0) {
        vec3 bent = cross(cross(s.bitangent, s.view_dir), s.bitangent);
        float straight = 1.0 - s.anisotropy * (1.0 - s.roughness);
        straight *= straight;
        normal = normalize(mix(normalize(bent + normal * 1e-6), normal, straight * straight));
    }
#endif
    return reflect(-s.view_dir, normal);
}

// The constant, or the environment's: what reaches a diffuse surface, for it to be multiplied with, and what is
// mirrored towards the viewer. The empirical models mirror nothing.
ReflectedLight environment_lighting(Surface s) {
#ifndef HAS_ENVIRONMENT
    return ReflectedLight(ambient, vec3(0.0));
#else
    ReflectedLight around = ReflectedLight(light_from(s.normal, 2.0), vec3(0.0));
#ifdef HAS_ENVIRONMENT_SPECULAR
    float NoV = clamp(dot(s.normal, s.view_dir), 0.0, 1.0);
    vec2 mirrored = textureLod(brdf_table, vec2(sqrt(NoV), s.roughness), 0.0).xy;
    float lobe = clamp(s.roughness, 0.0, 1.0);  // a compiler that sees its range leaves out all other lobes
    around.specular = light_from(reflection_direction(s), lobe) * (s.f0 * mirrored.x + s.f90 * mirrored.y);
#if MULTIPLE_SCATTERING
    // Light that leaves a rough surface after more than one reflection (Turquin 2019).
    around.specular *= 1.0 + s.f0 * (1.0 / max(mirrored.x + mirrored.y, 1e-3) - 1.0);
#endif
#if ENVIRONMENT_PART == ENVIRONMENT_PART_TABLE
    around.specular = vec3(mirrored, 0.0);
#endif
#endif
#if ENVIRONMENT_PART == ENVIRONMENT_PART_DIFFUSE
    around.specular = vec3(0.0);
#elif ENVIRONMENT_PART != ENVIRONMENT_PART_ALL
    around.diffuse = vec3(0.0);
#endif
    return around;
#endif
}

// How much of what is mirrored is not hidden, where `open` of a diffuse surface's light is not (Lagarde 2014).
float specular_occlusion(Surface s, float open) {
#if SPECULAR_OCCLUSION
    float NoV = clamp(dot(s.normal, s.view_dir), 1e-4, 1.0);
    return clamp(pow(NoV + open, exp2(-16.0 * s.roughness - 1.0)) - 1.0 + open, 0.0, 1.0);
#else
    return open;
#endif
}
