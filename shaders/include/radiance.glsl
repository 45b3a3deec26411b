// Outgoing radiance of a surface, from its emission, direct lighting and environment lighting.
#include <environment_lighting.glsl>

#if defined(UNLIT) || defined(NEEDS_NOTHING)
#define NO_LIGHTS
#endif

#ifdef HAS_OCCLUSION
uniform sampler2D occlusion;
#endif

const float MAX_HALF_FLOAT = 65504.0;  // larger values would overflow to infinity in a half-float texture

// The view-independent part, which lights other surfaces.
ReflectedLight diffuse_only(ReflectedLight light) {
    return ReflectedLight(light.diffuse, vec3(0.0));
}

// The sum of the terms that the parameter `terms` selects.
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

// Radiance towards the viewer: emission, direct lighting, and environment lighting scaled by the occlusion of the
// material and of the screen-space `occlusion`. Terms that are not selected are left out.
vec3 radiance_of(Surface s, ReflectedLight direct, ReflectedLight environment) {
#ifdef NO_LIGHTS
    return unlit_radiance(s);
#else
    vec3 sum = vec3(0.0);
#if TERMS == TERMS_ALL || TERMS == TERMS_EMISSIVE
    sum += s.emissive;
#endif
#if TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT
#ifdef HAS_OCCLUSION
    s.occlusion *= texelFetch(occlusion, ivec2(gl_FragCoord.xy), 0).r;
#endif
#ifdef HAS_ENVIRONMENT_SPECULAR
    sum += environment.diffuse * s.diffuse * s.occlusion + environment.specular * specular_occlusion(s, s.occlusion);
#else
    sum += environment.diffuse * s.ambient * s.occlusion;
#endif
#endif
    return min(sum + selected_terms(direct), MAX_HALF_FLOAT);
#endif
}
