// Adapts to the picture's average luminance over time, and derives the exposure.
#include <frame.glsl>

#if METHOD == METHOD_HISTOGRAM
layout(std430) readonly buffer histogram { uint bins[BINS]; };
uniform float low_percentile;
uniform float high_percentile;
#else
uniform sampler2D log_mean;      // one texel: weighted logarithm, weight
#endif
#ifdef HAS_BEFORE
uniform sampler2D before;        // one texel: adapted luminance of the previous frame, 0 in the first
#endif
uniform float key;
uniform float limit;             // stops
uniform float compensation;      // stops
uniform float start;             // luminance in the first frame; 0: the picture's own
uniform float seconds_to_light;
uniform float seconds_to_dark;
out float luminance;
out float gain;

// The picture's average luminance; 0 if nothing counts.
float average_luminance() {
#if METHOD == METHOD_HISTOGRAM
    float total = 0.0;
    for (int i = 0; i < BINS; ++i) total += float(bins[i]);
    float low = total * low_percentile / 100.0, high = total * high_percentile / 100.0;
    float below = 0.0, weights = 0.0, stops = 0.0;
    for (int i = 0; i < BINS; ++i) {
        float count = float(bins[i]);
        float inside = max(min(below + count, high) - max(below, low), 0.0);  // the part between the percentiles
        stops += inside * (float(i) + 0.5);
        weights += inside;
        below += count;
    }
    return weights > 0.0 ? exp2(stops / weights / BINS_PER_STOP + FIRST_STOP) : 0.0;
#else
    vec2 weighted = texelFetch(log_mean, ivec2(0), 0).xy;
    return weighted.y > 0.0 ? exp(weighted.x / weighted.y) : 0.0;
#endif
}

// Limits the luminance before the eye adapts, which would otherwise spend time outside the limits.
float limited(float average) {
    return clamp(average, key * exp2(-limit), key * exp2(limit));
}

void main() {
    float target = average_luminance();
    if (target == 0.0) target = key;  // an empty picture has a gain of 1
    target = limited(target);
#ifdef HAS_BEFORE
    float previous = texelFetch(before, ivec2(0), 0).r;
    if (previous > 0.0) {
        float seconds = target > previous ? seconds_to_light : seconds_to_dark;
        target = mix(target, previous, seconds > 0.0 ? exp(-delta_time / seconds) : 0.0);
    } else if (start > 0.0) {
        target = limited(start);
    }
#endif
    luminance = target;
    gain = key / target * exp2(compensation);
}
