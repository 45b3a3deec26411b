// Phong 1975: kd N.L + ks (R.V)^n, without 1/pi; no highlight where the surface faces away from the light.
#pragma needs(phong)
Reflected reflected(Surface s, vec3 to_light) {
    float n_l = dot(s.normal, to_light);
    vec3 mirrored = 2.0 * n_l * s.normal - to_light;
    float highlight = pow(max(dot(mirrored, s.to_viewer), 1e-6), s.exponent);
    return Reflected(s.diffuse * max(n_l, 0.0), n_l > 0.0 ? s.f0 * highlight : vec3(0.0));
}
