// Cook-Torrance: Lambert, and GGX with Smith visibility and Schlick's Fresnel. The diffuse part is not reduced by F.
#pragma needs(grain_where_any)
#include <anisotropic_ggx.glsl>

ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = max(dot(s.normal, light_dir), 0.0);
    float NoV = max(dot(s.normal, s.view_dir), 1e-4);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    float VoH = max(dot(s.view_dir, half_vector), 0.0);
    float alpha = max(s.roughness * s.roughness, 0.001);
#if SMITH == SMITH_FAST
    float visibility_term = visibility_smith_fast(NoL, NoV, alpha);
#else
    float visibility_term = visibility_smith(NoL, NoV, alpha);
#endif
    float specular = distribution_ggx(s.normal, half_vector, alpha) * visibility_term;
#ifdef NEEDS_GRAIN
    if (s.anisotropy > 0.0) specular = anisotropic_specular(s, light_dir, half_vector, NoL, NoV);
#endif
    return ReflectedLight(s.diffuse * (NoL / PI), fresnel_schlick(s.f0, s.f90, VoH) * specular * NoL);
}
