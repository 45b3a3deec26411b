// Pictures in a grid, row by row from the upper left, with labels.
#include <srgb.glsl>
#include <text.glsl>

const int DISPLAY_COLOR = 0, VALUES = 1, GREY = 2;  // sRGB encoded; values from 0 to 1; the same of one channel
uniform int kinds[PICTURES_COUNT];
uniform ivec2 sizes[PICTURES_COUNT];
uniform ivec4 rectangles[PICTURES_COUNT];  // upper left corner on the sheet, width, height
uniform int characters[PICTURES_COUNT * LABEL_LENGTH];
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

vec4 fetch_picture(int picture, ivec2 texel) {
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

// The value of a texel of a picture, decoded to light; texels count from the upper left.
vec3 picture_value(int picture, ivec2 texel) {
    vec4 value = fetch_picture(picture, ivec2(texel.x, sizes[picture].y - 1 - texel.y));
    if (kinds[picture] == GREY) value = value.rrrr;
    value = clamp(value, 0.0, 1.0);
    return kinds[picture] == DISPLAY_COLOR ? srgb_to_linear(value.rgb) : value.rgb;
}

// The area-weighted mean of the texels of a picture that a texel of the sheet covers, or the nearest texel of a picture
// that is enlarged.
vec3 resampled_value(int picture, ivec2 texel, ivec2 target_size) {
    vec2 scale = vec2(sizes[picture]) / vec2(target_size);
    if (all(lessThanEqual(scale, vec2(1.0)))) return picture_value(picture, ivec2((vec2(texel) + 0.5) * scale));
    vec2 low = vec2(texel) * scale, high = min(low + scale, vec2(sizes[picture]));
    vec3 sum = vec3(0.0);
    for (int y = int(low.y); float(y) < high.y; ++y) {
        for (int x = int(low.x); float(x) < high.x; ++x) {
            vec2 source = vec2(x, y), overlap = max(min(source + 1.0, high) - max(source, low), 0.0);
            sum += picture_value(picture, ivec2(source)) * overlap.x * overlap.y;
        }
    }
    return sum / ((high.x - low.x) * (high.y - low.y));
}

const int NO_LABEL = 0, LABEL_BACKGROUND = 1, LABEL_TEXT = 2;

// The part of a picture's label at a texel, counted from the upper left; `scale` is in texels per font pixel.
int label_at(int picture, ivec2 texel, int scale) {
    int count = 0;
    for (int i = 0; i < LABEL_LENGTH; ++i) {
        if (characters[picture * LABEL_LENGTH + i] != BLANK) count = i + 1;
    }
    if (count == 0 || texel.x >= (4 * count + 3) * scale || texel.y >= 9 * scale) return NO_LABEL;
    ivec2 pixel = texel / scale - 2;
    if (pixel.x < 0 || pixel.x / 4 >= count) return LABEL_BACKGROUND;
    int character = characters[picture * LABEL_LENGTH + pixel.x / 4];
    return glyph_pixel(character, ivec2(pixel.x % 4, 4 - pixel.y)) ? LABEL_TEXT : LABEL_BACKGROUND;
}

void main() {
    ivec2 sheet_texel = ivec2(gl_FragCoord.xy);
    sheet_texel.y = SHEET_HEIGHT - 1 - sheet_texel.y;
    color = vec4(linear_to_srgb(vec3(background)), 1.0);
    for (int i = 0; i < PICTURES_COUNT; ++i) {
        ivec2 texel = sheet_texel - rectangles[i].xy, size = rectangles[i].zw;
        if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, size))) continue;
        vec3 value = resampled_value(i, texel, size);
        color.rgb = kinds[i] == DISPLAY_COLOR ? linear_to_srgb(value) : value;
        int label = label_at(i, texel, max(1, SHEET_HEIGHT / 240));
        if (label != NO_LABEL) color.rgb = label == LABEL_BACKGROUND ? color.rgb * 0.25 : vec3(1.0);
    }
}
