// The terms of a surface's radiance put together.
#include <shading.glsl>

#if defined(UNLIT) || SHADING == SHADING_UNLIT
#define NO_LIGHTS
#endif

const float LARGEST = 65504.0;  // of half floats: what is brighter would be stored as infinity

// The wanted terms of reflected light.
vec3 terms_of(Reflected light) {
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
    return min(s.base_color, LARGEST);
#else
    return vec3(0.0);
#endif
}

// Radiance towards the viewer: the wanted terms.
vec3 radiance_of(Surface s, Reflected light, vec3 ambient) {
#ifdef NO_LIGHTS
    return unlit_radiance(s);
#else
    vec3 sum = vec3(0.0);
#if TERMS == TERMS_ALL || TERMS == TERMS_EMISSIVE
    sum += s.emissive;
#endif
#if TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT
    sum += ambient * s.ambient * s.occlusion;
#endif
    return min(sum + terms_of(light), LARGEST);
#endif
}
