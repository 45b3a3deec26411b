// The outputs of a lighting step and their values. Unused ones do not exist. Alpha is coverage; it is 0 where
// a step leaves an output as it is, because what it draws is blended over the output or added to it.
#include <radiance.glsl>

out vec4 radiance;  // scene-linear
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without the specular part and without air
#endif
#ifdef WRITES_DIRECT_DIFFUSE
out vec4 direct_diffuse;
#endif
#ifdef WRITES_DIRECT_SPECULAR
out vec4 direct_specular;
#endif
#ifdef WRITES_ENVIRONMENT_REFLECTION
out vec4 environment_reflection;
#endif
#ifdef WRITES_SPECULAR_ALBEDO
out vec4 specular_albedo;
#endif
#ifdef WRITES_IRRADIANCE
out vec4 irradiance;
#endif

// Sets every output but `radiance` to one value.
void set_parts(vec4 value) {
#ifdef WRITES_DIFFUSE
    diffuse = value;
#endif
#ifdef WRITES_DIRECT_DIFFUSE
    direct_diffuse = value;
#endif
#ifdef WRITES_DIRECT_SPECULAR
    direct_specular = value;
#endif
#ifdef WRITES_ENVIRONMENT_REFLECTION
    environment_reflection = value;
#endif
#ifdef WRITES_SPECULAR_ALBEDO
    specular_albedo = value;
#endif
#ifdef WRITES_IRRADIANCE
    irradiance = value;
#endif
}

// Outputs where there is no surface.
void write_background(vec4 background) {
    set_parts(vec4(0.0));
    radiance = background;
#ifdef WRITES_DIFFUSE
    diffuse = background;
#endif
}

// Outputs of a surface whose material is unlit, in a step that lights others.
void write_unlit(Surface s) {
    set_parts(vec4(vec3(0.0), s.alpha));
    vec3 emitted = unlit_radiance(s);
    radiance = vec4(through_air(s.position, emitted) * s.alpha, s.alpha);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(emitted * s.alpha, s.alpha);
#endif
}

vec3 selected_diffuse(ReflectedLight direct) {
    return min(selected_terms(diffuse_only(direct)), MAX_HALF_FLOAT);
}

vec3 selected_specular(ReflectedLight direct) {
    return min(selected_terms(ReflectedLight(vec3(0.0), direct.specular)), MAX_HALF_FLOAT);
}

// Outputs of a step that adds direct lighting to a picture.
void write_direct(Surface s, ReflectedLight direct) {
    set_parts(vec4(0.0));
    radiance = vec4(attenuated(s.position, min(selected_terms(direct), MAX_HALF_FLOAT)), 0.0);
#ifdef WRITES_DIFFUSE
    diffuse.rgb = selected_diffuse(direct);
#endif
#ifdef WRITES_DIRECT_DIFFUSE
    direct_diffuse.rgb = selected_diffuse(direct);
#endif
#ifdef WRITES_DIRECT_SPECULAR
    direct_specular.rgb = selected_specular(direct);
#endif
#ifdef WRITES_IRRADIANCE
    irradiance.rgb = min(direct_irradiance, MAX_HALF_FLOAT);
#endif
}

// Outputs of a surface, premultiplied. `environment` is what `environment_lighting` returns.
void write_light(Surface s, ReflectedLight direct, ReflectedLight environment) {
    radiance = vec4(through_air(s.position, radiance_of(s, direct, environment)) * s.alpha, s.alpha);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, direct, environment, false) * s.alpha, s.alpha);
#endif
#ifdef WRITES_DIRECT_DIFFUSE
    direct_diffuse = vec4(selected_diffuse(direct) * s.alpha, s.alpha);
#endif
#ifdef WRITES_DIRECT_SPECULAR
    direct_specular = vec4(selected_specular(direct) * s.alpha, s.alpha);
#endif
#if defined(TRANSPARENT) && defined(TRANSMISSION_LAYER)
    radiance.a *= transmitted_coverage(s);
#endif
    // A transparent surface dims the albedo of the opaque surface behind it, and leaves its other factors as they are.
#ifdef WRITES_ENVIRONMENT_REFLECTION
    environment_reflection = vec4(min(occluded_reflection(s), MAX_HALF_FLOAT), 1.0);
#endif
#ifdef WRITES_SPECULAR_ALBEDO
    specular_albedo = vec4(specular_reflectance(s), 1.0);
#endif
#ifdef WRITES_IRRADIANCE
    irradiance = vec4(min(direct_irradiance + environment_irradiance(s, environment), MAX_HALF_FLOAT), 1.0);
#endif
#ifdef ALPHA_BLEND
#ifdef WRITES_ENVIRONMENT_REFLECTION
    environment_reflection = vec4(0.0);
#endif
#ifdef WRITES_SPECULAR_ALBEDO
    specular_albedo = vec4(vec3(0.0), s.alpha);
#endif
#ifdef WRITES_IRRADIANCE
    irradiance = vec4(0.0);
#endif
#endif
}
