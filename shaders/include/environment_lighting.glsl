// Lighting of a surface by the environment, or by the constant ambient light. rendergraph provides `light_from()`.
#include <layers.glsl>
#include <shading.glsl>

uniform vec3 ambient;
#if !defined(NEEDS_PHONG) && !defined(NEEDS_NOTHING)
#ifdef HAS_ENVIRONMENT
#define HAS_ENVIRONMENT_SPECULAR
#endif
#if defined(HAS_ENVIRONMENT) || defined(HAS_REFLECTIONS) || defined(WRITES_SPECULAR_ALBEDO)
#define HAS_ENVIRONMENT_BRDF
#include <brdf_table.glsl>
#endif
#endif

// The direction in which the specular lobe is looked up. For anisotropic surfaces the normal is bent towards the normal
// of a cylinder along the grain (Revie 2012), more for rough surfaces, as in KHR_materials_anisotropy.
vec3 reflection_direction(Surface s) {
    vec3 normal = s.normal;
#ifdef NEEDS_GRAIN
    if (s.anisotropy > 0.0) {
        vec3 bent_normal = cross(cross(s.bitangent, s.view_dir), s.bitangent);
        float isotropy = 1.0 - s.anisotropy * (1.0 - s.roughness);
        isotropy *= isotropy;
        normal = normalize(mix(normalize(bent_normal + normal * 1e-6), normal, isotropy * isotropy));
    }
#endif
    return reflect(-s.view_dir, normal);
}

// Fraction of the environment's light in the specular lobe that the surface reflects to the viewer: the second factor
// of the split sum (Karis 2013). The empirical shading models reflect none.
vec3 specular_reflectance(Surface s) {
#ifdef IRIDESCENCE_LAYER
    s.f0 = s.film_f0;
#endif
#ifdef HAS_ENVIRONMENT_BRDF
    return ggx_albedo(s.f0, s.f90, clamp(dot(s.normal, s.view_dir), 0.0, 1.0), s.roughness);
#else
    return vec3(0.0);
#endif
}

// Light of the environment in the specular lobe: the first factor of the split sum.
vec3 prefiltered_environment(Surface s) {
#if !defined(HAS_ENVIRONMENT_SPECULAR) || ENVIRONMENT_PART == ENVIRONMENT_PART_DIFFUSE
    return vec3(0.0);
#else
    return light_from(reflection_direction(s), clamp(s.roughness, 0.0, 1.0));
#endif
}

#if defined(HAS_LAYERS) && defined(HAS_ENVIRONMENT_SPECULAR)
// The environment's light that the layered surface reflects, given the light `base` that its base reflects.
ReflectedLight layered_environment(Surface s, ReflectedLight base) {
    float NoV = clamp(dot(s.normal, s.view_dir), 0.0, 1.0);
#ifdef SHEEN_LAYER
    float albedo = sheen_albedo(s, NoV), left = below_sheen(s, albedo);
    // The lobe of fibres is about as wide as that of microfacets of the same roughness.
    vec3 scattered = light_from(reflect(-s.view_dir, s.normal), clamp(s.sheen_roughness, 0.0, 1.0));
    base.diffuse *= left;
    base.specular = base.specular * left + s.sheen_color * min(albedo, 1.0) * scattered;
#endif
#ifdef CLEARCOAT_LAYER
    float coat_NoV = clamp(dot(s.clearcoat_normal, s.view_dir), 0.0, 1.0);
    float coat = s.clearcoat * ggx_albedo(vec3(0.04), 1.0, coat_NoV, s.clearcoat_roughness).r;
    base.diffuse *= 1.0 - coat;
    vec3 reflected = light_from(reflect(-s.view_dir, s.clearcoat_normal), clamp(s.clearcoat_roughness, 0.0, 1.0));
    base.specular = base.specular * (1.0 - coat) + coat * reflected;
#endif
    return base;
}
#endif

// Light reflected from the environment, or the ambient constant: radiance towards the viewer. The diffuse part is not
// yet multiplied by the diffuse reflectance. The empirical shading models reflect no specular environment light.
ReflectedLight environment_lighting(Surface s) {
#ifndef HAS_ENVIRONMENT
    return ReflectedLight(ambient, vec3(0.0));
#else
#ifdef IRIDESCENCE_LAYER
    s.f0 = s.film_f0;
#endif
    ReflectedLight light = ReflectedLight(light_from(s.normal, 2.0), vec3(0.0));
#ifdef HAS_ENVIRONMENT_SPECULAR
    float NoV = clamp(dot(s.normal, s.view_dir), 0.0, 1.0);
    vec2 brdf = textureLod(brdf_table, vec2(sqrt(NoV), s.roughness), 0.0).xy;
    float lobe = clamp(s.roughness, 0.0, 1.0);  // the explicit range lets compilers remove the other kinds of lobe
    light.specular = light_from(reflection_direction(s), lobe) * (s.f0 * brdf.x + s.f90 * brdf.y);
#if MULTIPLE_SCATTERING
    // Energy compensation for multiple scattering between microfacets (Turquin 2019).
    light.specular *= 1.0 + s.f0 * (1.0 / max(brdf.x + brdf.y, 1e-3) - 1.0);
#endif
#ifdef HAS_LAYERS
    light = layered_environment(s, light);
#endif
#if ENVIRONMENT_PART == ENVIRONMENT_PART_TABLE
    light.specular = vec3(brdf, 0.0);
#endif
#endif
#if ENVIRONMENT_PART == ENVIRONMENT_PART_DIFFUSE
    light.specular = vec3(0.0);
#elif ENVIRONMENT_PART != ENVIRONMENT_PART_ALL
    light.diffuse = vec3(0.0);
#endif
    return light;
#endif
}

// Visibility of the specular environment light, from the ambient occlusion of the diffuse light (Lagarde 2014).
float specular_occlusion(Surface s, float occlusion) {
#if SPECULAR_OCCLUSION
    float NoV = clamp(dot(s.normal, s.view_dir), 1e-4, 1.0);
    return clamp(pow(NoV + occlusion, exp2(-16.0 * s.roughness - 1.0)) - 1.0 + occlusion, 0.0, 1.0);
#else
    return occlusion;
#endif
}
