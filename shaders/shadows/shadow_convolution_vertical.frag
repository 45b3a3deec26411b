// Terms of the Fourier series of the depth z in one layer of a shadow map, averaged along columns: sin(c z) and cos(c
// z) with c = π (2 k - 1), two terms per texture. The first pass also writes the coverage.
#include "range_fraction.glsl"
#include <math.glsl>

uniform sampler2D shadow_map;
uniform int first_row;  // of the current band, in the map
uniform int radius;     // texels
out vec4 filtered_map;
#if PARTS > 1
out vec4 filtered_map_1;
#endif
#if PARTS > 2
out vec4 filtered_map_2;
#endif
#if PARTS > 3
out vec4 filtered_map_3;
#endif
#ifdef WRITES_COVERAGE
out float coverage;
#endif

// Sine and cosine of the sum of two angles, from the sine and cosine of each.
vec2 angle_sum(vec2 a, vec2 b) {
    return vec2(b.x * a.y + b.y * a.x, b.y * a.y - b.x * a.x);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    View view = shadow_map_views[LAYER];
    float taps = float(2 * radius + 1);
    float covered = 0.0;
    vec4 sums[PARTS];
    for (int part = 0; part < PARTS; ++part) sums[part] = vec4(0.0);
    for (int i = -radius; i <= radius; ++i) {
        ivec2 tap = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, tap, 0).r;
        if (is_nothing(depth)) continue;
        float angle = PI * range_fraction(view, vec3((vec2(tap) + 0.5) * view.viewport.zw, depth));
        float c = float(4 * FIRST_PART + 1);
        vec2 term = vec2(sin(c * angle), cos(c * angle));
        vec2 step_to_next = vec2(sin(2.0 * angle), cos(2.0 * angle));
        for (int part = 0; part < PARTS; ++part) {
            vec2 next_term = angle_sum(step_to_next, term);
            sums[part] += vec4(term, next_term);
            term = angle_sum(step_to_next, next_term);
        }
        covered += 1.0;
    }
    filtered_map = sums[0] / taps;
#if PARTS > 1
    filtered_map_1 = sums[1] / taps;
#endif
#if PARTS > 2
    filtered_map_2 = sums[2] / taps;
#endif
#if PARTS > 3
    filtered_map_3 = sums[3] / taps;
#endif
#ifdef WRITES_COVERAGE
    coverage = covered / taps;
#endif
}
