// Tone mapping: exposure, a shoulder, then the sRGB transfer function (IEC 61966-2-1).
// A curve is an include with
//
//     vec3 tone_curve(vec3 color)
//
// that maps exposed scene-linear colour, from 0 to infinity, to display-linear. Results are clamped to 0 to 1.
#if RADIANCE_SAMPLES > 1
uniform sampler2DMS radiance;  // scene-linear
#else
uniform sampler2D radiance;  // scene-linear
#endif
#ifdef HAS_GAIN
uniform sampler2D gain;      // one texel: factor in addition to `exposure`
#endif
uniform float exposure;      // stops
uniform float white_balance; // kelvin
uniform float contrast;
uniform float saturation;
uniform float white;         // luminance after exposure that becomes white, for curves that use it
out vec4 color;              // display-referred

#include <CURVE>
#include <srgb.glsl>
#include <color_temperature.glsl>
#include <luminance.glsl>
#if DITHER
#include <noise.glsl>
#endif
#if defined(LOOK_LINEAR) || defined(LOOK_DISPLAY)
#include "look.glsl"
#endif

// White balance, contrast about middle grey and saturation. Neutral settings are skipped, so that the picture stays
// bit-identical.
vec3 graded(vec3 c) {
    if (white_balance != 6500.0) c = max(adapted_to_daylight(c, white_balance), 0.0);
    if (contrast != 1.0) c = 0.18 * pow(c / 0.18, vec3(contrast));
    if (saturation != 1.0) c = max(mix(vec3(luminance_of(c)), c, saturation), 0.0);
    return c;
}

void main() {
    float scale = exp2(exposure);
#ifdef HAS_GAIN
    scale *= texelFetch(gain, ivec2(0), 0).r;
#endif
    vec3 sum = vec3(0.0);
#if TRANSPARENT
    float covered = 0.0;
#endif
    bool broken = false;
    for (int i = 0; i < RADIANCE_SAMPLES; ++i) {
#if TRANSPARENT
        vec4 texel = texelFetch(radiance, ivec2(gl_FragCoord.xy), i);
        float alpha = clamp(texel.a, 0.0, 1.0);
        vec3 light = texel.rgb / max(alpha, 1e-4);
        covered += alpha;
#else
        vec3 light = texelFetch(radiance, ivec2(gl_FragCoord.xy), i).rgb;
#endif
        broken = broken || any(isnan(light));
        vec3 scene = max(light, 0.0) * scale;
        scene = graded(min(scene, 1e9));
#ifdef LOOK_LINEAR
        scene = linear_look(scene);
#endif
#if TRANSPARENT
        sum += clamp(tone_curve(scene), 0.0, 1.0) * alpha;
#else
        sum += clamp(tone_curve(scene), 0.0, 1.0);
#endif
    }
#if TRANSPARENT
    color = vec4(linear_to_srgb(sum / max(covered, 1e-4)), covered / float(RADIANCE_SAMPLES));
#else
    color = vec4(linear_to_srgb(sum / float(RADIANCE_SAMPLES)), 1.0);
#endif
#ifdef LOOK_DISPLAY
    color.rgb = clamp(through_table(color.rgb), 0.0, 1.0);
#endif
#if TRANSPARENT
    color.rgb *= color.a;
#endif
#if DITHER
    color.rgb += (interleaved_gradient_noise(gl_FragCoord.xy) - 0.5) * (0.998 / 255.0);  // keeps exact 8-bit values
#endif
    if (broken)
        color.rgb = vec3(1.0, 0.0, 1.0);  // makes NaN visible in the picture
}
