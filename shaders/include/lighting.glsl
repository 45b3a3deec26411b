// Direct lighting of a surface. rendergraph provides `shadow()`, and with HAS_LIGHT_LIST the list of the lights that
// may reach a position. With WRITES_SHADOW_DIFFERENCE, visibility is looked up at two positions within the texel
// instead of at the surface's own. Their mean is used for lighting, and their difference is accumulated.
#include <layered_light.glsl>
#include <lights.glsl>
#include <luminance.glsl>
#include <radiance.glsl>

#ifdef WRITES_SHADOW_DIFFERENCE
vec3 shadow_positions[2], shadow_normals[2];
// Luminance of the irradiance without shadows, and the part of it whose visibility differs between the two positions.
float unshadowed_luminance = 0.0, luminance_difference = 0.0;
#endif

// Light of one source that the surface reflects to the viewer; `light` is its index in the scene.
ReflectedLight direct_lighting(Surface s, int light) {
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
    vec3 light_dir;
    vec3 irradiance = irradiance_from(lights[light], s.position, light_dir);
    if (dot(s.normal, light_dir) > 0.0) {
#ifdef WRITES_SHADOW_DIFFERENCE
        float visibility0 = shadow(light, shadow_positions[0], shadow_normals[0]);
        float visibility1 = shadow(light, shadow_positions[1], shadow_normals[1]);
        float unshadowed = luminance_of(irradiance) * dot(s.normal, light_dir);
        unshadowed_luminance += unshadowed;
        luminance_difference += unshadowed * abs(visibility0 - visibility1);
        float light_visibility = 0.5 * (visibility0 + visibility1);
#else
        float light_visibility = shadow(light, s.position, s.geometric_normal);
#endif
        irradiance *= light_visibility;
    }
    ReflectedLight reflectance = shade(s, light_dir);
#ifdef HAS_LAYERS
    reflectance = layered_light(s, light_dir, reflectance);
#endif
#if defined(WRITES_IRRADIANCE) && (TERMS == TERMS_ALL || TERMS == TERMS_DIFFUSE)
    s.diffuse = vec3(1.0);
    direct_irradiance += PI * shade(s, light_dir).diffuse * irradiance;
#endif
    return ReflectedLight(reflectance.diffuse * irradiance, reflectance.specular * irradiance);
#else
    return ReflectedLight(vec3(0.0), vec3(0.0));
#endif
}

// Adds the light of one source to `sum`; with DIRECTIONALS_ONLY, only of a directional light.
void add_direct_lighting(Surface s, int light, inout ReflectedLight sum) {
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
#ifdef DIRECTIONALS_ONLY
    if (lights[light].position.w > 0.0) return;
#endif
    ReflectedLight reflected = direct_lighting(s, light);
    sum.diffuse += reflected.diffuse;
    sum.specular += reflected.specular;
#endif
}

// Light of all sources, or of those in the list for the surface's position.
ReflectedLight direct_lighting(Surface s) {
    ReflectedLight sum = ReflectedLight(vec3(0.0), vec3(0.0));
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
#ifdef HAS_LIGHT_LIST
    int count = light_count(s.position);
    for (int k = 0; k < count; ++k) add_direct_lighting(s, light_at(k), sum);
#else
    for (int i = 0; i < LIGHT_COUNT; ++i) add_direct_lighting(s, i, sum);
#endif
#endif
    return sum;
}
