// Outputs of a filter pass. The last pass (FINAL) writes the node's outputs at full size, all others write their value
// for the next pass.
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
#ifdef WRITES_REFLECTIONS
out vec4 reflections;
#endif
#else
out Value filtered;
#endif

#if defined(FINAL) && defined(WRITES_OCCLUSION) && defined(MULTI_BOUNCE)
uniform float albedo;

// Ambient visibility with interreflection between surfaces of one albedo (J. Jimenez et al., 2016: a fit to path
// tracing).
float multi_bounce(float visibility) {
    float a = 2.0404 * albedo - 0.3324;
    float b = -4.7951 * albedo + 0.6417;
    float c = 2.7552 * albedo + 0.6903;
    return max(visibility, ((a * visibility + b) * visibility + c) * visibility);
}
#endif

void write_outputs(Value value) {
#ifdef FINAL
    float visibility = ambient_visibility(value);
#ifdef WRITES_OCCLUSION
#ifdef MULTI_BOUNCE
    occlusion = multi_bounce(clamp(visibility, 0.0, 1.0));
#else
    occlusion = visibility;
#endif
#endif
#ifdef WRITES_BENT_NORMAL
    bent_normal = vec4(value.xyz * inversesqrt(max(dot(value.xyz, value.xyz), 1e-20)), 0.0);
#endif
#ifdef WRITES_INDIRECT
    indirect = vec4(value.xyz, 1.0);
#endif
#ifdef WRITES_REFLECTIONS
    reflections = value;
#endif
#else
    filtered = value;
#endif
}
