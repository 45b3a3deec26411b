// GGX over a surface with a grain: rough by alpha across it, and by mix(alpha, 1, strength^2) along the tangent, as
// KHR_materials_anisotropy has it.
#include <brdf.glsl>

// Distribution times visibility, D V; the half vector is unit, `NoL` and `NoV` are at least 0.
float anisotropic_specular(Surface s, vec3 to_light, vec3 half_vector, float NoL, float NoV) {
    float alpha_b = max(s.roughness * s.roughness, 0.001);
    float alpha_t = mix(alpha_b, 1.0, s.anisotropy * s.anisotropy);
    float d = distribution_ggx_anisotropic(
        max(dot(s.normal, half_vector), 0.0), dot(s.tangent, half_vector), dot(s.bitangent, half_vector), alpha_t, alpha_b);
    vec3 light = vec3(dot(s.tangent, to_light), dot(s.bitangent, to_light), NoL);
    vec3 viewer = vec3(dot(s.tangent, s.view_dir), dot(s.bitangent, s.view_dir), NoV);
    return d * visibility_smith_anisotropic(light, viewer, alpha_t, alpha_b);
}
