// Bright pass: the light above a luminance threshold. A node by itself, and with DOWNSAMPLE the first step of `bloom`,
// at half size.
/*---
doc: |
  Extract the light above a luminance threshold: `rgb max(L - threshold, 0) / L`.

  Hues are kept, and the result starts at black, so that nothing pops when a light crosses the threshold.
inputs:
  radiance: {semantic: radiance, doc: Scene-linear radiance.}
  gain: {semantic: exposure_gain, size: any, optional: true, doc: Exposure applied before the threshold.}
outputs:
  bright: {semantic: radiance, like: radiance, doc: "Light above the threshold; scene-linear, alpha unchanged."}
params:
  threshold: {default: 1.0, min: 0, doc: "Luminance, after `gain`, that is subtracted; 1 is the display's white."}
---*/
#include <luminance.glsl>
#include <downsample.glsl>

uniform sampler2D radiance;  // scene-linear
#ifdef HAS_GAIN
uniform sampler2D gain;      // one texel: exposure applied before the threshold
#endif
uniform float threshold;
out vec4 bright;

vec4 source_texel(ivec2 texel) {
    vec4 source = texelFetch(radiance, texel, 0);
    float luminance = luminance_of(source.rgb);
#ifdef HAS_GAIN
    luminance *= texelFetch(gain, ivec2(0), 0).r;
#endif
    // Comparisons are false for NaN, so NaN becomes black; a blur would spread it.
    float fraction = luminance > threshold ? 1.0 - threshold / luminance : 0.0;
    return vec4(fraction > 0.0 ? min(source.rgb * fraction, 60000.0) : vec3(0.0), source.a);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#ifdef DOWNSAMPLE
    bright = downsample(texel, textureSize(radiance, 0));
#else
    bright = source_texel(texel);
#endif
}
