// Blinn 1977: kd NoL + ks NoH^(4n), without 1/π. The exponent is four times Phong's, for a highlight of about equal
// size.
#pragma needs(phong)
ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = dot(s.normal, light_dir);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    float highlight = pow(max(dot(s.normal, half_vector), 1e-6), 4.0 * s.exponent);
    return ReflectedLight(s.diffuse * max(NoL, 0.0), NoL > 0.0 ? s.f0 * highlight : vec3(0.0));
}
