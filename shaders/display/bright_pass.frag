// What is above a luminance: a node by itself, and at half size (HALVE) the first step of `bloom`.
/*---
doc: |
  The part of the picture above a luminance: `rgb max(L - threshold, 0) / L`.

  What is left keeps its hue and begins at black, so nothing pops where a light crosses the threshold.
inputs:
  radiance: {semantic: radiance, doc: Scene-linear radiance.}
  gain: {semantic: exposure_gain, size: any, optional: true, doc: Exposure that the threshold is measured after.}
outputs:
  bright: {semantic: radiance, like: radiance, doc: "What is above the threshold; scene-linear, alpha as it was."}
params:
  threshold: {default: 1.0, min: 0, doc: "Luminance, after `gain`, that is taken off; 1 is the display's white."}
---*/
#include <luminance.glsl>
#include <downsample.glsl>

uniform sampler2D radiance;  // scene-linear
#ifdef HAS_GAIN
uniform sampler2D gain;      // one texel: the exposure that the threshold is measured after
#endif
uniform float threshold;
out vec4 bright;

vec4 source_texel(ivec2 texel) {
    vec4 here = texelFetch(radiance, texel, 0);
    float exposed = luminance_of(here.rgb);
#ifdef HAS_GAIN
    exposed *= texelFetch(gain, ivec2(0), 0).r;
#endif
    // Written so that what is not a number goes out, which a blur would spread.
    float share = exposed > threshold ? 1.0 - threshold / exposed : 0.0;
    return vec4(share > 0.0 ? min(here.rgb * share, 60000.0) : vec3(0.0), here.a);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#ifdef HALVE
    bright = downsample(texel, textureSize(radiance, 0));
#else
    bright = source_texel(texel);
#endif
}
