// Resolves samples with a tone-mapped mean: samples are compressed before averaging, and the mean is expanded again.
// Weights: B. Karis, "Tone Mapping", Graphic Rants, 2013.
#include <luminance.glsl>

uniform sampler2DMS source;  // scene-linear
#ifdef HAS_GAIN
uniform sampler2D gain;      // one texel: factor in addition to `exposure`
#endif
uniform float exposure;      // stops
out vec4 radiance;

void main() {
    float scale = exp2(exposure);
#ifdef HAS_GAIN
    scale *= texelFetch(gain, ivec2(0), 0).r;
#endif
    vec4 sum = vec4(0.0);
    float total_weight = 0.0;
    for (int i = 0; i < SOURCE_SAMPLES; ++i) {
        vec4 value = texelFetch(source, ivec2(gl_FragCoord.xy), i);
        value.rgb = max(value.rgb * scale, 0.0);
#if AVERAGE == AVERAGE_KARIS
        float weight = 1.0 / (1.0 + luminance_of(value.rgb));
        sum += vec4(value.rgb * weight, value.a);
#else
        float weight = 1.0;
        sum += vec4(value.rgb / (1.0 + value.rgb), value.a);
#endif
        total_weight += weight;
    }
#if AVERAGE == AVERAGE_KARIS
    radiance.rgb = sum.rgb / (total_weight * scale);
#else
    vec3 mean = sum.rgb / total_weight;
    radiance.rgb = mean / (max(1.0 - mean, 1e-7) * scale);
#endif
    radiance.a = sum.a / float(SOURCE_SAMPLES);
}
