// Cook-Torrance: Lambert and GGX with Smith visibility and Schlick's Fresnel. The diffuse part is not reduced by F.
#pragma needs(grain_where_any)
#include <anisotropic_ggx.glsl>

ReflectedLight shade(Surface s, vec3 to_light) {
    float NoL = max(dot(s.normal, to_light), 0.0);
    float NoV = max(dot(s.normal, s.view_dir), 1e-4);
    vec3 half_vector = normalize(to_light + s.view_dir);
    float VoH = max(dot(s.view_dir, half_vector), 0.0);
    float alpha = max(s.roughness * s.roughness, 0.001);
#if SMITH == SMITH_FAST
    float visible = visibility_smith_fast(NoL, NoV, alpha);
#else
    float visible = visibility_smith(NoL, NoV, alpha);
#endif
    float facets = distribution_ggx(s.normal, half_vector, alpha) * visible;
#ifdef NEEDS_GRAIN
    if (s.anisotropy > 0.0) facets = anisotropic_specular(s, to_light, half_vector, NoL, NoV);
#endif
    return ReflectedLight(s.diffuse * (NoL / PI), fresnel_schlick(s.f0, s.f90, VoH) * facets * NoL);
}
