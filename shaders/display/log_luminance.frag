// Logarithms of luminance, averaged to half size. Further downsampling yields their mean.
#include <luminance.glsl>
#include <downsample.glsl>

uniform sampler2D radiance;  // scene-linear, alpha is coverage
uniform float delta;         // keeps black finite
out vec2 logarithms;         // x = weighted logarithm, y = weight

vec4 source_texel(ivec2 texel) {
    vec4 source = texelFetch(radiance, texel, 0);
    float luminance = luminance_of(source.rgb);
    luminance = luminance > 0.0 ? min(luminance, 1e9) : 0.0;  // NaN becomes black; adaptation would keep it for ever
#if METER == METER_COVERED
    float weight = clamp(source.a, 0.0, 1.0);
#else
    float weight = 1.0;
#endif
    return vec4(weight * log(delta + luminance), weight, 0.0, 0.0);
}

void main() {
    logarithms = downsample(ivec2(gl_FragCoord.xy), textureSize(radiance, 0)).xy;
}
