// Shoulders: scene-linear colour after exposure, 0 to infinity, to display-linear colour, 0 to about 1.
#include <luminance.glsl>

// Khronos Group, "PBR Neutral Tone Mapper", 2024. Takes off what a dielectric's 4 % reflection adds, keeps hues up to
// 0.8 - 0.04, then compresses the brightest channel and lets the colour fade to white.
vec3 neutral_curve(vec3 c) {
    const float start = 0.8 - 0.04;
    const float fade = 0.15;
    float least = min(c.r, min(c.g, c.b));
    c -= least < 0.08 ? least - 6.25 * least * least : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < start) return c;
    float room = 1.0 - start;
    float compressed = 1.0 - room * room / (peak + room - start);
    return mix(vec3(compressed), c * (compressed / peak), 1.0 / (fade * (peak - compressed) + 1.0));
}

// K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2015: a rational fit, per channel.
vec3 aces_curve(vec3 c) {
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
}

// E. Reinhard, M. Stark, P. Shirley and J. Ferwerda, "Photographic Tone Reproduction for Digital Images", 2002: per
// channel, on luminance alone, and with the least luminance that becomes white.
vec3 reinhard_curve(vec3 c) {
    return c / (1.0 + c);
}

vec3 reinhard_luminance_curve(vec3 c) {
    return c / (1.0 + luminance_of(c));
}

vec3 reinhard_extended_curve(vec3 c, float white) {
    float l = luminance_of(c);
    return c * ((1.0 + l / (white * white)) / (1.0 + l));
}

// J. Hable, "Filmic Tonemapping Operators", 2010: a film's toe and shoulder, per channel, with his exposure of one stop
// and his linear white of 11.2.
vec3 hable_film(vec3 c) {
    const float shoulder = 0.15, linear = 0.50, angle = 0.10, toe = 0.20, toe_up = 0.02, toe_down = 0.30;
    vec3 up = c * (shoulder * c + angle * linear) + toe * toe_up;
    vec3 down = c * (shoulder * c + linear) + toe * toe_down;
    return up / down - toe_up / toe_down;
}

vec3 hable_curve(vec3 c) {
    return hable_film(2.0 * c) / hable_film(vec3(11.2));
}
