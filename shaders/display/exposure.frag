// Adapts to the log-average luminance over time, and derives the exposure.
#include <frame.glsl>

uniform sampler2D log_mean;      // one texel: weighted logarithm, weight
#ifdef HAS_BEFORE
uniform sampler2D before;        // one texel: adapted luminance of the previous frame, 0 in the first
#endif
uniform float key;
uniform float start;             // luminance in the first frame; 0: the picture's own
uniform float seconds_to_light;
uniform float seconds_to_dark;
out float luminance;
out float gain;

void main() {
    vec2 weighted = texelFetch(log_mean, ivec2(0), 0).xy;
    float target = weighted.y > 0.0 ? exp(weighted.x / weighted.y) : key;  // an empty picture has a gain of 1
#ifdef HAS_BEFORE
    float previous = texelFetch(before, ivec2(0), 0).r;
    if (previous > 0.0) {
        float seconds = target > previous ? seconds_to_light : seconds_to_dark;
        target = mix(target, previous, seconds > 0.0 ? exp(-delta_time / seconds) : 0.0);
    } else if (start > 0.0) {
        target = start;
    }
#endif
    luminance = target;
    gain = key / target;
}
