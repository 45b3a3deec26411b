// Cook-Torrance with a grain on every surface. At strength 0 it is the isotropic model with the exact visibility.
#pragma needs(grain)
#include <anisotropic_ggx.glsl>

ReflectedLight shade(Surface s, vec3 to_light) {
    float NoL = max(dot(s.normal, to_light), 0.0);
    float NoV = max(dot(s.normal, s.view_dir), 1e-4);
    vec3 half_vector = normalize(to_light + s.view_dir);
    vec3 fresnel = fresnel_schlick(s.f0, s.f90, max(dot(s.view_dir, half_vector), 0.0));
    return ReflectedLight(s.diffuse * (NoL / PI), fresnel * (anisotropic_specular(s, to_light, half_vector, NoL, NoV) * NoL));
}
