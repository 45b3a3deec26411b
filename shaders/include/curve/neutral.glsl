// Khronos Group, "PBR Neutral Tone Mapper", 2024. Subtracts the 4 % Fresnel reflection of dielectrics, preserves
// colours up to 0.8 - 0.04, then compresses the brightest channel and desaturates towards white.
vec3 tone_curve(vec3 c) {
    const float compression_start = 0.8 - 0.04;
    const float desaturation = 0.15;
    float minimum = min(c.r, min(c.g, c.b));
    c -= minimum < 0.08 ? minimum - 6.25 * minimum * minimum : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < compression_start) return c;
    float headroom = 1.0 - compression_start;
    float compressed = 1.0 - headroom * headroom / (peak + headroom - compression_start);
    return mix(vec3(compressed), c * (compressed / peak), 1.0 / (desaturation * (peak - compressed) + 1.0));
}
