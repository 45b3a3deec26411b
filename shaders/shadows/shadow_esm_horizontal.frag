// Second axis of the filter of `shadow_esm_vertical.frag`: averages along rows.
uniform sampler2D filtered_columns;
uniform sampler2D coverage_columns;
uniform int first_row;  // of the current band, in the map
uniform int radius;     // texels
out float filtered_map;
out float coverage;

const float LOG_ZERO = -1e30;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(0, first_row);
    int last = textureSize(filtered_columns, 0).x - 1;
    float maximum = LOG_ZERO;
    float sum = 0.0;  // of exponentials, divided by exp(maximum)
    coverage = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 tap = ivec2(clamp(texel.x + i, 0, last), texel.y);
        float value = texelFetch(filtered_columns, tap, 0).r;
        sum = value > maximum ? sum * exp(maximum - value) + 1.0 : sum + exp(value - maximum);
        maximum = max(maximum, value);
        coverage += texelFetch(coverage_columns, tap, 0).r;
    }
    float taps = float(2 * radius + 1);
    filtered_map = maximum > LOG_ZERO ? maximum + log(sum / taps) : LOG_ZERO;
    coverage /= taps;
}
