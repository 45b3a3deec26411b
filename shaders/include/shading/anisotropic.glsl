// Cook-Torrance with a grain: roughness alpha across it, and mix(alpha, 1, strength^2) along the tangent, as
// KHR_materials_anisotropy has it. At strength 0 it is the isotropic model with the exact visibility.
#pragma needs(grain)
#include <brdf.glsl>

Reflected reflected(Surface s, vec3 to_light) {
    float n_l = max(dot(s.normal, to_light), 0.0);
    float n_v = max(dot(s.normal, s.to_viewer), 1e-4);
    vec3 half_way = normalize(to_light + s.to_viewer);
    float v_h = max(dot(s.to_viewer, half_way), 0.0);
    float alpha_b = max(s.roughness * s.roughness, 0.001);
    float alpha_t = mix(alpha_b, 1.0, s.anisotropy * s.anisotropy);
    float d = distribution_ggx_anisotropic(
        max(dot(s.normal, half_way), 0.0), dot(s.tangent, half_way), dot(s.bitangent, half_way), alpha_t, alpha_b);
    vec3 light = vec3(dot(s.tangent, to_light), dot(s.bitangent, to_light), n_l);
    vec3 viewer = vec3(dot(s.tangent, s.to_viewer), dot(s.bitangent, s.to_viewer), n_v);
    float visible = visibility_smith_anisotropic(light, viewer, alpha_t, alpha_b);
    return Reflected(s.diffuse * (n_l / PI), fresnel_schlick(s.f0, s.f90, v_h) * (d * visible * n_l));
}
