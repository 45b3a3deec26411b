// Radiance of a surface: its terms put together.
#include <shading.glsl>

#if defined(UNLIT) || defined(NEEDS_NOTHING)
#define NO_LIGHTS
#endif

uniform vec3 ambient;
#ifdef HAS_OCCLUSION
uniform sampler2D occlusion;
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

// Radiance towards the viewer: the wanted terms. Ambient light is what the surface and the picture leave open.
vec3 radiance_of(Surface s, Reflected light) {
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
    sum += ambient * s.ambient * s.occlusion;
#endif
    return min(sum + terms_of(light), LARGEST);
#endif
}
