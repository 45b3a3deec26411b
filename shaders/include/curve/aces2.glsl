// Academy Color Encoding System 2.0 (2024), output transform for sRGB at 100 nits. It compresses lightness, chroma and
// gamut in a perceptual space; `curve_table` holds its values, display-encoded, over the logarithm of each channel.
#pragma needs(curve_table)
#include <srgb.glsl>

uniform sampler3D curve_table;

vec3 tone_curve(vec3 c) {
    const float darkest = exp2(-10.0), range = 17.0;  // in stops; as in `_aces2.py`
    vec3 place = clamp(log2(c / darkest + 1.0) / log2(exp2(range) + 1.0), 0.0, 1.0);
    float size = float(textureSize(curve_table, 0).x);
    return srgb_to_linear(texture(curve_table, (place * (size - 1.0) + 0.5) / size).rgb);
}
