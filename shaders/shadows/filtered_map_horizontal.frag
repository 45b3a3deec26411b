// Second axis of the separable filter: averages along rows.
uniform sampler2D filtered_columns;
#ifdef WRITES_COVERAGE
uniform sampler2D coverage_columns;
out float coverage;
#endif
uniform int first_row;  // of the current band, in the map
uniform int radius;     // texels
out vec4 filtered_map;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(0, first_row);
    int last = textureSize(filtered_columns, 0).x - 1;
    filtered_map = vec4(0.0);
    float coverage_sum = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 tap = ivec2(clamp(texel.x + i, 0, last), texel.y);
        filtered_map += texelFetch(filtered_columns, tap, 0);
#ifdef WRITES_COVERAGE
        coverage_sum += texelFetch(coverage_columns, tap, 0).r;
#endif
    }
    float taps = float(2 * radius + 1);
    filtered_map /= taps;
#ifdef WRITES_COVERAGE
    coverage = coverage_sum / taps;
#endif
}
