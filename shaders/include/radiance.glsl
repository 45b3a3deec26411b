// Radiance of a surface: its terms put together.
#include <environment_lighting.glsl>

#if defined(UNLIT) || defined(NEEDS_NOTHING)
#define NO_LIGHTS
#endif

#ifdef HAS_OCCLUSION
uniform sampler2D occlusion;
#endif

const float MAX_HALF_FLOAT = 65504.0;  // of half floats: what is brighter would be stored as infinity

// The part that is the same seen from all sides, which is what lights other surfaces.
ReflectedLight diffuse_only(ReflectedLight light) {
    return ReflectedLight(light.diffuse, vec3(0.0));
}

// The wanted terms of reflected light.
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

// What an unlit surface shows: its base colour, as emission.
vec3 unlit_radiance(Surface s) {
#if TERMS == TERMS_ALL || TERMS == TERMS_EMISSIVE
    return min(s.base_color, MAX_HALF_FLOAT);
#else
    return vec3(0.0);
#endif
}

// Radiance towards the viewer: the wanted terms of what lights and what all around reflect, of the latter what surface
// and picture leave open.
vec3 radiance_of(Surface s, ReflectedLight light, ReflectedLight around) {
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
    sum += around.diffuse * s.diffuse * s.occlusion + around.specular * specular_occlusion(s, s.occlusion);
#else
    sum += around.diffuse * s.ambient * s.occlusion;
#endif
#endif
    return min(sum + selected_terms(light), MAX_HALF_FLOAT);
#endif
}
