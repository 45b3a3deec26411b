// Blinn 1977: kd N.L + ks (N.H)^(4n), without 1/pi; four times Phong's exponent draws about the same highlight.
#pragma needs(phong)
Reflected reflected(Surface s, vec3 to_light) {
    float n_l = dot(s.normal, to_light);
    vec3 half_way = normalize(to_light + s.to_viewer);
    float highlight = pow(max(dot(s.normal, half_way), 1e-6), 4.0 * s.exponent);
    return Reflected(s.diffuse * max(n_l, 0.0), n_l > 0.0 ? s.f0 * highlight : vec3(0.0));
}
