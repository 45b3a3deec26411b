// Blinn 1977: kd N.L + ks (N.H)^(4n), without 1/pi; four times Phong's exponent draws about the same highlight.
#pragma needs(phong)
ReflectedLight shade(Surface s, vec3 to_light) {
    float NoL = dot(s.normal, to_light);
    vec3 half_vector = normalize(to_light + s.view_dir);
    float highlight = pow(max(dot(s.normal, half_vector), 1e-6), 4.0 * s.exponent);
    return ReflectedLight(s.diffuse * max(NoL, 0.0), NoL > 0.0 ? s.f0 * highlight : vec3(0.0));
}
