// Pictures in a grid, row by row from the upper left, with labels.
#include <srgb.glsl>
#include <text.glsl>

const int ENCODED = 0, PLAIN = 1, GREY = 2;  // display colour; values as they are; one channel of them
uniform int kinds[PICTURES_COUNT];
uniform ivec2 sizes[PICTURES_COUNT];
uniform ivec4 places[PICTURES_COUNT];  // on the sheet: the upper left, width and height
uniform int letters[PICTURES_COUNT * LETTERS];
uniform float background;  // display-linear
out vec4 color;

uniform sampler2D pictures_0;
#if PICTURES_COUNT > 1
uniform sampler2D pictures_1;
#endif
#if PICTURES_COUNT > 2
uniform sampler2D pictures_2;
#endif
#if PICTURES_COUNT > 3
uniform sampler2D pictures_3;
#endif
#if PICTURES_COUNT > 4
uniform sampler2D pictures_4;
#endif
#if PICTURES_COUNT > 5
uniform sampler2D pictures_5;
#endif
#if PICTURES_COUNT > 6
uniform sampler2D pictures_6;
#endif
#if PICTURES_COUNT > 7
uniform sampler2D pictures_7;
#endif
#if PICTURES_COUNT > 8
uniform sampler2D pictures_8;
#endif
#if PICTURES_COUNT > 9
uniform sampler2D pictures_9;
#endif
#if PICTURES_COUNT > 10
uniform sampler2D pictures_10;
#endif
#if PICTURES_COUNT > 11
uniform sampler2D pictures_11;
#endif

vec4 texel_of(int picture, ivec2 texel) {
    switch (picture) {
        case 0: return texelFetch(pictures_0, texel, 0);
#if PICTURES_COUNT > 1
        case 1: return texelFetch(pictures_1, texel, 0);
#endif
#if PICTURES_COUNT > 2
        case 2: return texelFetch(pictures_2, texel, 0);
#endif
#if PICTURES_COUNT > 3
        case 3: return texelFetch(pictures_3, texel, 0);
#endif
#if PICTURES_COUNT > 4
        case 4: return texelFetch(pictures_4, texel, 0);
#endif
#if PICTURES_COUNT > 5
        case 5: return texelFetch(pictures_5, texel, 0);
#endif
#if PICTURES_COUNT > 6
        case 6: return texelFetch(pictures_6, texel, 0);
#endif
#if PICTURES_COUNT > 7
        case 7: return texelFetch(pictures_7, texel, 0);
#endif
#if PICTURES_COUNT > 8
        case 8: return texelFetch(pictures_8, texel, 0);
#endif
#if PICTURES_COUNT > 9
        case 9: return texelFetch(pictures_9, texel, 0);
#endif
#if PICTURES_COUNT > 10
        case 10: return texelFetch(pictures_10, texel, 0);
#endif
#if PICTURES_COUNT > 11
        case 11: return texelFetch(pictures_11, texel, 0);
#endif
    }
    return vec4(0.0);
}

// A picture's value at a place counted from its upper left; what is decoded is light.
vec3 value_at(int picture, ivec2 place) {
    vec4 found = texel_of(picture, ivec2(place.x, sizes[picture].y - 1 - place.y));
    if (kinds[picture] == GREY) found = found.rrrr;
    found = clamp(found, 0.0, 1.0);
    return kinds[picture] == ENCODED ? srgb_to_linear(found.rgb) : found.rgb;
}

// The mean over what a texel of the sheet covers of a picture, by area; a single texel of one that is enlarged.
vec3 mean_at(int picture, ivec2 place, ivec2 shown) {
    vec2 scale = vec2(sizes[picture]) / vec2(shown);
    if (all(lessThanEqual(scale, vec2(1.0)))) return value_at(picture, ivec2((vec2(place) + 0.5) * scale));
    vec2 low = vec2(place) * scale, high = min(low + scale, vec2(sizes[picture]));
    vec3 sum = vec3(0.0);
    for (int y = int(low.y); float(y) < high.y; ++y) {
        for (int x = int(low.x); float(x) < high.x; ++x) {
            vec2 at = vec2(x, y), covered = max(min(at + 1.0, high) - max(at, low), 0.0);
            sum += value_at(picture, ivec2(at)) * covered.x * covered.y;
        }
    }
    return sum / ((high.x - low.x) * (high.y - low.y));
}

// How much of a label is at a place counted from its upper left: 0 nothing, 1 its ground, 2 a letter.
int label_at(int picture, ivec2 place, int dots) {
    int count = 0;
    for (int i = 0; i < LETTERS; ++i) {
        if (letters[picture * LETTERS + i] != BLANK) count = i + 1;
    }
    if (count == 0 || place.x >= (4 * count + 3) * dots || place.y >= 9 * dots) return 0;
    ivec2 dot = place / dots - 2;
    if (dot.x < 0 || dot.x / 4 >= count) return 1;
    return glyph_pixel(letters[picture * LETTERS + dot.x / 4], ivec2(dot.x % 4, 4 - dot.y)) ? 2 : 1;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    at.y = SHEET_HEIGHT - 1 - at.y;
    color = vec4(linear_to_srgb(vec3(background)), 1.0);
    for (int i = 0; i < PICTURES_COUNT; ++i) {
        ivec2 place = at - places[i].xy, shown = places[i].zw;
        if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, shown))) continue;
        vec3 mean = mean_at(i, place, shown);
        color.rgb = kinds[i] == ENCODED ? linear_to_srgb(mean) : mean;
        int label = label_at(i, place, max(1, SHEET_HEIGHT / 240));
        if (label > 0) color.rgb = label == 1 ? color.rgb * 0.25 : vec3(1.0);
    }
}
