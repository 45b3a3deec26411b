// From the mean of the logarithms to the luminance the eye is adapted to, and to the exposure that follows from it.
#include <frame.glsl>

uniform sampler2D mean;          // one texel: weighted logarithm, weight
#ifdef HAS_BEFORE
uniform sampler2D before;        // one texel: last frame's adapted luminance, 0 before the first
#endif
uniform float key;
uniform float start;             // luminance in the first frame, 0 for the picture's own
uniform float seconds_to_light;
uniform float seconds_to_dark;
out float luminance;
out float gain;

void main() {
    vec2 sum = texelFetch(mean, ivec2(0), 0).xy;
    float target = sum.y > 0.0 ? exp(sum.x / sum.y) : key;  // nothing to see: no exposure
#ifdef HAS_BEFORE
    float old = texelFetch(before, ivec2(0), 0).r;
    if (old > 0.0) {
        float seconds = target > old ? seconds_to_light : seconds_to_dark;
        target = mix(target, old, seconds > 0.0 ? exp(-delta_time / seconds) : 0.0);
    } else if (start > 0.0) {
        target = start;
    }
#endif
    luminance = target;
    gain = key / target;
}
