// Tone mapping: exposure, a shoulder, then the sRGB transfer function (IEC 61966-2-1).
// A curve is an include with
//
//     vec3 tone_curve(vec3 color)
//
// from scene-linear after exposure, 0 to infinity, to display-linear; what leaves 0 to 1 is clipped.
uniform sampler2D radiance;  // scene-linear
#ifdef HAS_GAIN
uniform sampler2D gain;      // one texel: a factor beside the stops
#endif
uniform float exposure;      // stops
uniform float white;         // luminance after exposure, for curves that have one
out vec4 color;              // display-referred

#include <CURVE>

vec3 srgb(vec3 c) {
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

void main() {
    vec3 scene = max(texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb, 0.0) * exp2(exposure);
#ifdef HAS_GAIN
    scene *= texelFetch(gain, ivec2(0), 0).r;
#endif
    color = vec4(srgb(clamp(tone_curve(min(scene, 1e9)), 0.0, 1.0)), 1.0);
}
