// The mean of the samples of a texel as they look on the display, as radiance again.
// Weights: B. Karis, "Tone Mapping", Graphic Rants, 2013.
#include <luminance.glsl>

uniform sampler2DMS source;  // scene-linear
#ifdef HAS_GAIN
uniform sampler2D gain;      // one texel: a factor beside the stops
#endif
uniform float exposure;      // stops
out vec4 radiance;

void main() {
    float scale = exp2(exposure);
#ifdef HAS_GAIN
    scale *= texelFetch(gain, ivec2(0), 0).r;
#endif
    vec4 sum = vec4(0.0);
    float weights = 0.0;
    for (int i = 0; i < SOURCE_SAMPLES; ++i) {
        vec4 one = texelFetch(source, ivec2(gl_FragCoord.xy), i);
        one.rgb = max(one.rgb * scale, 0.0);
#if AVERAGE == AVERAGE_KARIS
        float weight = 1.0 / (1.0 + luminance_of(one.rgb));
        sum += vec4(one.rgb * weight, one.a);
#else
        float weight = 1.0;
        sum += vec4(one.rgb / (1.0 + one.rgb), one.a);
#endif
        weights += weight;
    }
#if AVERAGE == AVERAGE_KARIS
    radiance.rgb = sum.rgb / (weights * scale);
#else
    vec3 mean = sum.rgb / weights;
    radiance.rgb = mean / (max(1.0 - mean, 1e-7) * scale);
#endif
    radiance.a = sum.a / float(SOURCE_SAMPLES);
}
