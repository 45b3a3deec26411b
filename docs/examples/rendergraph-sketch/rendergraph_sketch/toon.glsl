// Three tones and a hard highlight, as cartoons are painted (Lake et al. 2000); without 1/pi, as the empirical models.
#pragma needs(phong)
const float DARK = 0.35, MIDDLE = 0.7;

Reflected reflected(Surface s, vec3 to_light) {
    float n_l = dot(s.normal, to_light);
    float tone = DARK * smoothstep(0.0, 0.02, n_l)
        + (MIDDLE - DARK) * smoothstep(0.3, 0.32, n_l)
        + (1.0 - MIDDLE) * smoothstep(0.65, 0.67, n_l);
    vec3 half_way = normalize(to_light + s.to_viewer);
    float highlight = pow(max(dot(s.normal, half_way), 1e-6), 4.0 * s.exponent);
    // The root of ks: as it is, what is not metal would hardly show a highlight.
    return Reflected(s.diffuse * tone, sqrt(s.f0) * smoothstep(0.45, 0.55, highlight) * step(0.0, n_l));
}
