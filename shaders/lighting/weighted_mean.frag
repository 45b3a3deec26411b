// The mean of blended surfaces, with the opacity that all of them have together.
#include <per_sample.glsl>

uniform SAMPLER_2D sums;  // colour and opacity, weighed
uniform SAMPLER_2D left;  // what shows of the background
out vec4 radiance;    // scene-linear, premultiplied; alpha is opacity

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 sum = texelFetch(sums, texel, SAMPLE_INDEX);
    if (sum.a == 0.0) discard;
    float opacity = 1.0 - texelFetch(left, texel, SAMPLE_INDEX).r;
    radiance = vec4(sum.rgb / sum.a, 1.0) * opacity;
}
