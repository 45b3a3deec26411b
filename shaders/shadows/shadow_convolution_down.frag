// Terms of the Fourier series of the depth z in one layer of a shadow map, averaged along columns: sin and cos of c z,
// c = pi (2 k - 1), two of them a texture; with the first two the share of texels where something is.
#include "range_fraction.glsl"
#include <math.glsl>

uniform sampler2D shadow_map;
uniform int first_row;  // of the band that is drawn, in the map
uniform int radius;     // texels
out vec4 filtered;
#if PARTS > 1
out vec4 filtered_1;
#endif
#if PARTS > 2
out vec4 filtered_2;
#endif
#if PARTS > 3
out vec4 filtered_3;
#endif
#ifdef WRITES_COVERED
out float covered;
#endif

// Sine and cosine of the sum of two angles.
vec2 turned(vec2 by, vec2 from) {
    return vec2(from.x * by.y + from.y * by.x, from.y * by.y - from.x * by.x);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    View view = shadow_map_views[LAYER];
    float taps = float(2 * radius + 1);
    float some = 0.0;
    vec4 sums[PARTS];
    for (int part = 0; part < PARTS; ++part) sums[part] = vec4(0.0);
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, other, 0).r;
        if (is_nothing(depth)) continue;
        float angle = PI * range_fraction(view, vec3((vec2(other) + 0.5) * view.viewport.zw, depth));
        float c = float(4 * FIRST_PART + 1);
        vec2 term = vec2(sin(c * angle), cos(c * angle));
        vec2 on = vec2(sin(2.0 * angle), cos(2.0 * angle));  // from each term to the next
        for (int part = 0; part < PARTS; ++part) {
            vec2 second = turned(on, term);
            sums[part] += vec4(term, second);
            term = turned(on, second);
        }
        some += 1.0;
    }
    filtered = sums[0] / taps;
#if PARTS > 1
    filtered_1 = sums[1] / taps;
#endif
#if PARTS > 2
    filtered_2 = sums[2] / taps;
#endif
#if PARTS > 3
    filtered_3 = sums[3] / taps;
#endif
#ifdef WRITES_COVERED
    covered = some / taps;
#endif
}
