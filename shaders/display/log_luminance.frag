// Logarithms of luminance, averaged to half size: the top of the chain that ends in their mean.
#include <luminance.glsl>
#include <downsample.glsl>

uniform sampler2D radiance;  // scene-linear, alpha is coverage
uniform float delta;         // keeps black finite
out vec2 logarithms;         // weighted logarithm, weight

vec4 source_texel(ivec2 texel) {
    vec4 here = texelFetch(radiance, texel, 0);
    float l = luminance_of(here.rgb);
    l = l > 0.0 ? min(l, 1e9) : 0.0;  // not a number counts as black: one such pixel must not blind the eye for good
#if METER == METER_COVERED
    float weight = clamp(here.a, 0.0, 1.0);
#else
    float weight = 1.0;
#endif
    return vec4(weight * log(delta + l), weight, 0.0, 0.0);
}

void main() {
    logarithms = downsample(ivec2(gl_FragCoord.xy), textureSize(radiance, 0)).xy;
}
