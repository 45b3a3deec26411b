// Adds a texture of light to a sum, or divides the sum by its number of terms, sample by sample. DECODE and ENCODE are
// defined for display colours, whose light is averaged.
#if SAMPLES > 1
uniform sampler2DMS source;
#define SAMPLE gl_SampleID
#else
uniform sampler2D source;
#define SAMPLE 0
#endif
uniform float divisor;
out vec4 value;

void main() {
    value = texelFetch(source, ivec2(gl_FragCoord.xy), SAMPLE);
#ifdef DECODE
    value.rgb = srgb_to_linear(value.rgb);
#endif
    value /= divisor;
#ifdef ENCODE
    value.rgb = linear_to_srgb(clamp(value.rgb, 0.0, 1.0));
#endif
}
