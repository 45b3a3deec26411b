// Cook-Torrance with anisotropic GGX. At strength 0 it equals the isotropic model with the exact visibility term.
#pragma needs(grain)
#include <anisotropic_ggx.glsl>

ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = max(dot(s.normal, light_dir), 0.0);
    float NoV = max(dot(s.normal, s.view_dir), 1e-4);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    vec3 fresnel = fresnel_schlick(s.f0, s.f90, max(dot(s.view_dir, half_vector), 0.0));
    vec3 specular = fresnel * (anisotropic_specular(s, light_dir, half_vector, NoL, NoV) * NoL);
    return ReflectedLight(s.diffuse * (NoL / PI), specular);
}
