// Anisotropic GGX, as in KHR_materials_anisotropy: the roughness is alpha across the grain (along the bitangent) and
// mix(alpha, 1, strength²) along the tangent.
#include <brdf.glsl>

// Distribution times visibility, D V, in 1/sr. NoL and NoV are at least 0.
float anisotropic_specular(Surface s, vec3 light_dir, vec3 half_vector, float NoL, float NoV) {
    float alpha_b = max(s.roughness * s.roughness, 0.001);
    float alpha_t = mix(alpha_b, 1.0, s.anisotropy * s.anisotropy);
    float NoH = max(dot(s.normal, half_vector), 0.0);
    float ToH = dot(s.tangent, half_vector), BoH = dot(s.bitangent, half_vector);
    vec3 tangent_light_dir = vec3(dot(s.tangent, light_dir), dot(s.bitangent, light_dir), NoL);
    vec3 tangent_view_dir = vec3(dot(s.tangent, s.view_dir), dot(s.bitangent, s.view_dir), NoV);
    return distribution_ggx_anisotropic(NoH, ToH, BoH, alpha_t, alpha_b)
        * visibility_smith_anisotropic(tangent_light_dir, tangent_view_dir, alpha_t, alpha_b);
}
