// Cook-Torrance with a grain on every surface. At strength 0 it is the isotropic model with the exact visibility.
#pragma needs(grain)
#include <grain.glsl>

Reflected reflected(Surface s, vec3 to_light) {
    float n_l = max(dot(s.normal, to_light), 0.0);
    float n_v = max(dot(s.normal, s.to_viewer), 1e-4);
    vec3 half_way = normalize(to_light + s.to_viewer);
    vec3 fresnel = fresnel_schlick(s.f0, s.f90, max(dot(s.to_viewer, half_way), 0.0));
    return Reflected(s.diffuse * (n_l / PI), fresnel * (facets_with_grain(s, to_light, half_way, n_l, n_v) * n_l));
}
