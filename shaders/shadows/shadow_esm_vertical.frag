// The logarithm of the mean of exponentials of depth along columns of one layer of a shadow map, and the coverage. The
// exponentials themselves would overflow, so their sum is kept relative to the largest one (log-sum-exp).
#include "view_depth.glsl"

uniform sampler2D shadow_map;
uniform int first_row;   // of the current band, in the map
uniform int radius;      // texels
uniform float exponent;  // 1/m
out float filtered_map;
out float coverage;

const float LOG_ZERO = -1e30;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    View view = shadow_map_views[LAYER];
    float maximum = LOG_ZERO;
    float sum = 0.0;  // of exponentials, divided by exp(maximum)
    coverage = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 tap = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, tap, 0).r;
        if (is_nothing(depth)) continue;
        float value = exponent * view_depth(view, vec3((vec2(tap) + 0.5) * view.viewport.zw, depth));
        sum = value > maximum ? sum * exp(maximum - value) + 1.0 : sum + exp(value - maximum);
        maximum = max(maximum, value);
        coverage += 1.0;
    }
    float taps = float(2 * radius + 1);
    filtered_map = sum > 0.0 ? maximum + log(sum / taps) : LOG_ZERO;
    coverage /= taps;
}
