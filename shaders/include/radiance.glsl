// Outgoing radiance of a surface, from its emission, direct lighting and environment lighting.
#include <air.glsl>
#include <environment_lighting.glsl>
#include <math.glsl>
#if defined(TRANSMISSION_LAYER) && defined(TRANSMITS)
#include <transmitted_light.glsl>
#endif

#if defined(UNLIT) || defined(NEEDS_NOTHING)
#define NO_LIGHTS
#endif

#ifdef HAS_OCCLUSION
uniform sampler2D occlusion;
#endif
#ifdef HAS_REFLECTIONS
uniform sampler2D reflections;  // rgb = radiance reflected to the viewer; alpha = confidence
#endif
#ifdef WRITES_IRRADIANCE
vec3 direct_irradiance = vec3(0.0);  // of all lights together
#endif

const float MAX_HALF_FLOAT = 65504.0;  // larger values would overflow to infinity in a half-float texture

// The view-independent part of reflected light, which lights other surfaces.
ReflectedLight diffuse_only(ReflectedLight light) {
    return ReflectedLight(light.diffuse, vec3(0.0));
}

// The sum of the terms of reflected light that the parameter `terms` selects.
vec3 selected_terms(ReflectedLight light) {
    vec3 sum = vec3(0.0);
#if TERMS == TERMS_ALL || TERMS == TERMS_DIFFUSE
    sum += light.diffuse;
#endif
#if TERMS == TERMS_ALL || TERMS == TERMS_SPECULAR
    sum += light.specular;
#endif
    return sum;
}

// Radiance of an unlit surface: it emits its base colour.
vec3 unlit_radiance(Surface s) {
#if TERMS == TERMS_ALL || TERMS == TERMS_EMISSIVE
    return min(s.base_color, MAX_HALF_FLOAT);
#else
    return vec3(0.0);
#endif
}

// Visibility of the environment: the material's occlusion times the screen-space `occlusion`.
float environment_visibility(Surface s) {
#ifdef HAS_OCCLUSION
    s.occlusion *= texelFetch(occlusion, ivec2(gl_FragCoord.xy), 0).r;
#endif
    return s.occlusion;
}

#ifdef HAS_REFLECTIONS
// The connected `reflections` at this fragment: radiance, and in alpha the confidence from 0 to 1.
vec4 reflections_at_fragment() {
    vec4 reflected = texelFetch(reflections, ivec2(gl_FragCoord.xy), 0);
    return reflected.a > 0.0 ? min(reflected, vec4(vec3(MAX_HALF_FLOAT), 1.0)) : vec4(0.0);
}
#endif

// The light of `environment`, scaled by occlusion and multiplied by the reflectance. `reflections` replace its specular
// part, weighted by their confidence. With constant ambient light, they replace the part that metals reflect. They are
// not occluded.
ReflectedLight reflected_environment(Surface s, ReflectedLight environment) {
#if !defined(NO_LIGHTS) && (TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT)
    float visibility = environment_visibility(s);
#ifdef HAS_ENVIRONMENT_SPECULAR
    environment.diffuse = environment.diffuse * s.diffuse * visibility;
    environment.specular *= specular_occlusion(s, visibility);
#endif
#ifdef HAS_REFLECTIONS
    vec4 reflected = reflections_at_fragment();
    s.ambient = mix(s.ambient, s.diffuse, reflected.a);
    environment.specular = mix(environment.specular, reflected.rgb * specular_reflectance(s), reflected.a);
#endif
#ifndef HAS_ENVIRONMENT_SPECULAR
    environment.diffuse = environment.diffuse * s.ambient * visibility;
#endif
    return environment;
#else
    return ReflectedLight(vec3(0.0), vec3(0.0));
#endif
}

// Irradiance from the environment, before albedo and scaled by occlusion.
vec3 environment_irradiance(Surface s, ReflectedLight environment) {
#if !defined(NO_LIGHTS) && (TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT)
    return PI * environment.diffuse * environment_visibility(s);
#else
    return vec3(0.0);
#endif
}

// Radiance that `specular_albedo` multiplies: the occluded prefiltered environment, or the `reflections` in its place.
vec3 occluded_reflection(Surface s) {
#if !defined(NO_LIGHTS) && (TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT)
    vec3 reflection = prefiltered_environment(s) * specular_occlusion(s, environment_visibility(s));
#ifdef HAS_REFLECTIONS
    vec4 reflected = reflections_at_fragment();
    reflection = mix(reflection, reflected.rgb, reflected.a);
#endif
    return reflection;
#else
    return vec3(0.0);
#endif
}

// Radiance towards the viewer from emission, `direct` lighting and `environment` lighting. Terms that are not selected
// are left out. `with_specular` is false for the part that lights other surfaces.
vec3 radiance_of(Surface s, ReflectedLight direct, ReflectedLight environment, bool with_specular) {
#ifdef NO_LIGHTS
    return unlit_radiance(s);
#else
    vec3 sum = vec3(0.0);
#if TERMS == TERMS_ALL || TERMS == TERMS_EMISSIVE
    sum += s.emissive;
#endif
#if defined(TRANSMISSION_LAYER) && defined(TRANSMITS) && TERMS == TERMS_ALL
    sum += transmitted_light(s);
#endif
#if TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT
    environment = reflected_environment(s, environment);
#if defined(HAS_ENVIRONMENT_SPECULAR) || defined(HAS_REFLECTIONS)
    sum += with_specular ? environment.diffuse + environment.specular : environment.diffuse;
#else
    sum += environment.diffuse;
#endif
#endif
    return min(sum + selected_terms(with_specular ? direct : diffuse_only(direct)), MAX_HALF_FLOAT);
#endif
}

// The same with the specular parts of `direct` and `environment` lighting.
vec3 radiance_of(Surface s, ReflectedLight direct, ReflectedLight environment) {
    return radiance_of(s, direct, environment, true);
}
