// Phong 1975: kd NoL + ks RoV^n, without 1/π. There is no highlight where the surface faces away from the light.
#pragma needs(phong)
ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = dot(s.normal, light_dir);
    vec3 reflection_dir = 2.0 * NoL * s.normal - light_dir;
    float highlight = pow(max(dot(reflection_dir, s.view_dir), 1e-6), s.exponent);
    return ReflectedLight(s.diffuse * max(NoL, 0.0), NoL > 0.0 ? s.f0 * highlight : vec3(0.0));
}
