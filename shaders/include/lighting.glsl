// A surface under all lights. `shadow()` is the framework's.
#include <lights.glsl>
#include <terms.glsl>

// Light of all punctual lights reflected to the viewer.
Reflected reflected_lights(Surface s) {
    Reflected sum = Reflected(vec3(0.0), vec3(0.0));
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 to_light;
        vec3 irradiance = irradiance_from(lights[i], s.position, to_light);
        if (dot(s.normal, to_light) > 0.0) irradiance *= shadow(i, s.position, s.geometric_normal);
        Reflected one = reflected(s, to_light);
        sum.diffuse += one.diffuse * irradiance;
        sum.specular += one.specular * irradiance;
    }
#endif
    return sum;
}
