// The weighted mean colour of the transparent surfaces, with their combined opacity.
#include <per_sample.glsl>

uniform SAMPLER_2D accumulation;  // weighted premultiplied colour and weighted opacity
uniform SAMPLER_2D revealage;     // visibility of the background
out vec4 radiance;                // scene-linear, premultiplied; alpha is opacity

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 sum = texelFetch(accumulation, texel, SAMPLE_INDEX);
    if (sum.a == 0.0) discard;
    float opacity = 1.0 - texelFetch(revealage, texel, SAMPLE_INDEX).r;
    radiance = vec4(sum.rgb / sum.a, 1.0) * opacity;
}
