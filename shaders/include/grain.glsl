// GGX over a surface with a grain: rough by alpha across it, and by mix(alpha, 1, strength^2) along the tangent, as
// KHR_materials_anisotropy has it.
#include <brdf.glsl>

// Distribution times visibility, D V; the half vector is unit, `n_l` and `n_v` are at least 0.
float facets_with_grain(Surface s, vec3 to_light, vec3 half_way, float n_l, float n_v) {
    float alpha_b = max(s.roughness * s.roughness, 0.001);
    float alpha_t = mix(alpha_b, 1.0, s.anisotropy * s.anisotropy);
    float d = distribution_ggx_anisotropic(
        max(dot(s.normal, half_way), 0.0), dot(s.tangent, half_way), dot(s.bitangent, half_way), alpha_t, alpha_b);
    vec3 light = vec3(dot(s.tangent, to_light), dot(s.bitangent, to_light), n_l);
    vec3 viewer = vec3(dot(s.tangent, s.to_viewer), dot(s.bitangent, s.to_viewer), n_v);
    return d * visibility_smith_anisotropic(light, viewer, alpha_t, alpha_b);
}
