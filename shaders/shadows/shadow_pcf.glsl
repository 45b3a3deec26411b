// Percentage-closer filtering (Reeves, Salesin and Cook 1987): TAPS x TAPS depth tests one texel apart, each weighted
// bilinearly, which is (TAPS + 1) x (TAPS + 1) texels with the outer ones counted by the part that is covered. Four
// tests come with one gather. One tap is the plain test of one texel.
uniform sampler2DArrayShadow shadow_map;

#if TAPS == 1
#define MAP_HALF_WIDTH 0.5
#else
#define MAP_HALF_WIDTH (0.5 * float(TAPS + 1))
#endif

#if TAPS == 1
float map_visibility(int layer, vec3 place) {
    return texture(shadow_map, vec4(place.xy, float(layer), place.z));
}
#else
// How much of texel `index` of TAPS + 1 the kernel covers, beginning at the fraction `start` of the first.
float covered(int index, float start) {
    return index == 0 ? 1.0 - start : index == TAPS ? start : index > TAPS ? 0.0 : 1.0;
}

float map_visibility(int layer, vec3 place) {
    vec2 size = vec2(textureSize(shadow_map, 0).xy);
    vec2 corner = place.xy * size - 0.5 * float(TAPS);
    vec2 first = floor(corner);
    vec2 start = corner - first;
    float sum = 0.0;
    for (int y = 0; y <= TAPS; y += 2) {
        for (int x = 0; x <= TAPS; x += 2) {
            vec2 middle = (first + vec2(x + 1, y + 1)) / size;
            // Upper left, upper right, lower right, lower left.
            vec4 lit = textureGather(shadow_map, vec3(middle, float(layer)), place.z);
            vec2 columns = vec2(covered(x, start.x), covered(x + 1, start.x));
            vec2 rows = vec2(covered(y, start.y), covered(y + 1, start.y));
            sum += dot(lit, vec4(columns.xyyx) * rows.yyxx);
        }
    }
    return sum / float(TAPS * TAPS);
}
#endif

#include "map_shadow.glsl"
