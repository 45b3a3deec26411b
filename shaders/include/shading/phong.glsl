// Phong 1975: kd N.L + ks (R.V)^n, without 1/pi; no highlight where the surface faces away from the light.
#pragma needs(phong)
ReflectedLight shade(Surface s, vec3 to_light) {
    float NoL = dot(s.normal, to_light);
    vec3 mirrored = 2.0 * NoL * s.normal - to_light;
    float highlight = pow(max(dot(mirrored, s.view_dir), 1e-6), s.exponent);
    return ReflectedLight(s.diffuse * max(NoL, 0.0), NoL > 0.0 ? s.f0 * highlight : vec3(0.0));
}
