// What the last pass of a technique writes, at full size and filtered; a pass before it (without FINAL) hands on.
#include "value.glsl"
#ifdef FINAL
#ifdef WRITES_OCCLUSION
out float occlusion;
#endif
#ifdef WRITES_BENT_NORMAL
out vec4 bent_normal;  // world space
#endif
#ifdef WRITES_INDIRECT
out vec4 indirect;
#endif
#else
out Value mean;
#endif

#if defined(FINAL) && defined(WRITES_OCCLUSION) && defined(MULTI_BOUNCE)
uniform float albedo;

// What light between surfaces of one albedo leaves of an occlusion (J. Jimenez et al., 2016: a fit to path tracing).
float brightened(float open) {
    float a = 2.0404 * albedo - 0.3324;
    float b = -4.7951 * albedo + 0.6417;
    float c = 2.7552 * albedo + 0.6903;
    return max(open, ((a * open + b) * open + c) * open);
}
#endif

void finish(Value value) {
#ifdef FINAL
    float open = openness(value);
#ifdef WRITES_OCCLUSION
#ifdef MULTI_BOUNCE
    occlusion = brightened(clamp(open, 0.0, 1.0));
#else
    occlusion = open;
#endif
#endif
#ifdef WRITES_BENT_NORMAL
    bent_normal = vec4(value.xyz * inversesqrt(max(dot(value.xyz, value.xyz), 1e-20)), 0.0);
#endif
#ifdef WRITES_INDIRECT
    indirect = vec4(value.xyz, 1.0);
#endif
#else
    mean = value;
#endif
}
