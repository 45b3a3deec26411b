// The terms of a surface's radiance put together.
#include <shading.glsl>

#if defined(UNLIT) || SHADING == SHADING_UNLIT
#define NO_LIGHTS
#endif

// Radiance towards the viewer: the wanted terms. An unlit surface emits its base colour.
vec3 radiance_of(Surface s, Reflected light, vec3 ambient) {
#ifdef NO_LIGHTS
    s.emissive = s.base_color;
#endif
    vec3 sum = vec3(0.0);
#if TERMS == TERMS_ALL || TERMS == TERMS_EMISSIVE
    sum += s.emissive;
#endif
#ifndef NO_LIGHTS
#if TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT
    sum += ambient * s.ambient * s.occlusion;
#endif
#if TERMS == TERMS_ALL || TERMS == TERMS_DIFFUSE
    sum += light.diffuse;
#endif
#if TERMS == TERMS_ALL || TERMS == TERMS_SPECULAR
    sum += light.specular;
#endif
#endif
    return min(sum, 65504.0);  // the largest half float: what is brighter would be stored as infinity
}
