// Tone mapping: exposure, a shoulder, then the sRGB transfer function (IEC 61966-2-1).
// Shoulders: Khronos Group, "PBR Neutral Tone Mapper", 2024; K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2015;
// E. Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002.
uniform sampler2D radiance;  // scene-linear
uniform float exposure;      // stops
out vec4 color;              // display-referred

// Takes off what a dielectric's 4 % reflection adds, keeps hues up to 0.8 - 0.04, then compresses the brightest channel
// and lets the colour fade to white.
vec3 neutral(vec3 c) {
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

vec3 shoulder(vec3 c) {
#if CURVE == CURVE_NEUTRAL
    return neutral(c);
#elif CURVE == CURVE_ACES
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
#elif CURVE == CURVE_REINHARD
    return c / (1.0 + c);
#else
    return c;
#endif
}

vec3 srgb(vec3 c) {
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

void main() {
    vec3 scene = max(texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb, 0.0) * exp2(exposure);
    color = vec4(srgb(clamp(shoulder(min(scene, 1e9)), 0.0, 1.0)), 1.0);
}
