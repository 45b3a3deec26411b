// A surface under all lights. `shadow()` is the framework's. With WRITES_SHADOW_DIFFERENCE it is looked up at two other
// places than the surface's, of which the mean lights it, and it is known afterwards by how much they differ.
#include <lights.glsl>
#include <luminance.glsl>
#include <radiance.glsl>

#ifdef WRITES_SHADOW_DIFFERENCE
vec3 shadow_positions[2], shadow_normals[2];
float could_reach = 0.0, changing = 0.0;  // irradiance without shadows, and what of it reaches one of the two places
#endif

// Light of one of them reflected to the viewer, by the scene's index.
ReflectedLight direct_lighting(Surface s, int light) {
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
    vec3 to_light;
    vec3 irradiance = irradiance_from(lights[light], s.position, to_light);
    if (dot(s.normal, to_light) > 0.0) {
#ifdef WRITES_SHADOW_DIFFERENCE
        float one = shadow(light, shadow_positions[0], shadow_normals[0]);
        float other = shadow(light, shadow_positions[1], shadow_normals[1]);
        float reaching = luminance_of(irradiance) * dot(s.normal, to_light);
        could_reach += reaching;
        changing += reaching * abs(one - other);
        float open = 0.5 * (one + other);
#else
        float open = shadow(light, s.position, s.geometric_normal);
#endif
        irradiance *= open;
    }
    ReflectedLight one = shade(s, to_light);
    return ReflectedLight(one.diffuse * irradiance, one.specular * irradiance);
#else
    return ReflectedLight(vec3(0.0), vec3(0.0));
#endif
}

// Light of all; with DIRECTIONALS_ONLY of those alone that shine everywhere.
ReflectedLight direct_lighting(Surface s) {
    ReflectedLight sum = ReflectedLight(vec3(0.0), vec3(0.0));
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
    for (int i = 0; i < LIGHT_COUNT; ++i) {
#ifdef DIRECTIONALS_ONLY
        if (lights[i].position.w > 0.0) continue;
#endif
        ReflectedLight one = direct_lighting(s, i);
        sum.diffuse += one.diffuse;
        sum.specular += one.specular;
    }
#endif
    return sum;
}
