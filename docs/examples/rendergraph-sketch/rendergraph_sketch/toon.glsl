// Cartoon shading with three tones and a hard highlight (Lake et al. 2000); without 1/π, like the empirical models.
#pragma needs(phong)
const float DARK = 0.35, MIDDLE = 0.7;

ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = dot(s.normal, light_dir);
    float tone = DARK * smoothstep(0.0, 0.02, NoL)
        + (MIDDLE - DARK) * smoothstep(0.3, 0.32, NoL)
        + (1.0 - MIDDLE) * smoothstep(0.65, 0.67, NoL);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    float highlight = pow(max(dot(s.normal, half_vector), 1e-6), 4.0 * s.exponent);
    // The square root of ks, because dielectrics would hardly show a highlight otherwise.
    return ReflectedLight(s.diffuse * tone, sqrt(s.f0) * smoothstep(0.45, 0.55, highlight) * step(0.0, NoL));
}
