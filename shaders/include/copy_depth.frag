// Copies depth into another depth texture.
#include <per_sample.glsl>

uniform SAMPLER_2D depth;

void main() {
    gl_FragDepth = texelFetch(depth, ivec2(gl_FragCoord.xy), SAMPLE_INDEX).r;
}
