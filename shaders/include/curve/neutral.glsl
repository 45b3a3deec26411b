// Khronos Group, "PBR Neutral Tone Mapper", 2024. Takes off what a dielectric's 4 % reflection adds, keeps hues up to
// 0.8 - 0.04, then compresses the brightest channel and lets the colour fade to white.
vec3 tone_curve(vec3 c) {
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
