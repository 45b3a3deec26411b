// Cook-Torrance: Lambert and GGX with Smith visibility and Schlick's Fresnel. The diffuse part is not reduced by F.
#pragma needs(grain_where_any)
#include <grain.glsl>

Reflected reflected(Surface s, vec3 to_light) {
    float n_l = max(dot(s.normal, to_light), 0.0);
    float n_v = max(dot(s.normal, s.to_viewer), 1e-4);
    vec3 half_way = normalize(to_light + s.to_viewer);
    float v_h = max(dot(s.to_viewer, half_way), 0.0);
    float alpha = max(s.roughness * s.roughness, 0.001);
#if SMITH == SMITH_FAST
    float visible = visibility_smith_fast(n_l, n_v, alpha);
#else
    float visible = visibility_smith(n_l, n_v, alpha);
#endif
    float facets = distribution_ggx(s.normal, half_way, alpha) * visible;
#ifdef NEEDS_GRAIN
    if (s.anisotropy > 0.0) facets = facets_with_grain(s, to_light, half_way, n_l, n_v);
#endif
    return Reflected(s.diffuse * (n_l / PI), fresnel_schlick(s.f0, s.f90, v_h) * facets * n_l);
}
