// Cook-Torrance with anisotropic GGX. At strength 0 it equals the isotropic model with the exact visibility term.
#pragma needs(grain)
#include <anisotropic_ggx.glsl>
#ifdef IRIDESCENCE_LAYER
#include <iridescence.glsl>
#endif

#ifdef SAMPLES_DIRECTIONS
#include <sampled_directions.glsl>
#define HAS_SAMPLED_DIRECTIONS

vec2 ggx_alphas(Surface s) {
    float alpha_b = max(s.roughness * s.roughness, 0.001);
    return vec2(mix(alpha_b, 1.0, s.anisotropy * s.anisotropy), alpha_b);
}

// Chance of the specular lobe.
float specular_share(Surface s) {
    float NoV = clamp(dot(s.normal, s.view_dir), 1e-4, 1.0);
    return lobe_share(fresnel_schlick(s.f0, s.f90, NoV), s.diffuse);
}

vec3 sample_direction(Surface s, vec3 xi) {
    mat3 frame = mat3(s.tangent, s.bitangent, s.normal);
    if (xi.z >= specular_share(s)) return frame * sample_cosine(xi.xy);
    vec3 v = viewer_above(s.view_dir * frame);
    return frame * reflect(-v, sample_visible_normal(v, ggx_alphas(s), xi.xy));
}

float direction_density(Surface s, vec3 light_dir) {
    mat3 frame = mat3(s.tangent, s.bitangent, s.normal);
    vec3 v = viewer_above(s.view_dir * frame), h = normalize(light_dir * frame + v);
    vec2 alpha = ggx_alphas(s);
    float share = specular_share(s), NoL = dot(s.normal, light_dir);
    if (h.z <= 0.0) return (1.0 - share) * max(NoL, 0.0) / PI;
    float distribution = distribution_ggx_anisotropic(h.z, h.x, h.y, alpha.x, alpha.y);
    return share * distribution * visible_normal_density(v, alpha) + (1.0 - share) * max(NoL, 0.0) / PI;
}
#endif

ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = max(dot(s.normal, light_dir), 0.0);
    float NoV = max(dot(s.normal, s.view_dir), 1e-4);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    float VoH = max(dot(s.view_dir, half_vector), 0.0);
    vec3 fresnel = fresnel_schlick(s.f0, s.f90, VoH);
#ifdef IRIDESCENCE_LAYER
    fresnel = mix(fresnel, film_reflectance(s.film_ior, s.film_thickness, s.f0, VoH), s.iridescence);
#endif
    vec3 specular = fresnel * (anisotropic_specular(s, light_dir, half_vector, NoL, NoV) * NoL);
    return ReflectedLight(s.diffuse * (NoL / PI), specular);
}
