// What a shading model knows of a point on a surface, whether it comes from geometry or from a G-buffer.
#include <materials.glsl>

#ifndef SHADING  // a pass that only writes surfaces down needs no model
#define SHADING 0
#define SHADING_UNLIT 0
#define SHADING_PHONG 1
#define SHADING_BLINN_PHONG 2
#define SHADING_ANISOTROPIC 3
#define SHADING_PBR 4
#endif

struct Surface {
    vec3 position;
    vec3 normal;            // unit, for shading
    vec3 geometric_normal;  // unit, of the triangle, towards the viewer
    vec3 to_viewer;         // unit
    vec3 tangent;           // unit, along the grain; used by the anisotropic model alone
    vec3 bitangent;
    vec3 base_color;
    vec3 diffuse;    // base colour without its metallic part, or kd
    vec3 f0;         // specular colour at normal incidence, or ks
    vec3 ambient;    // what an even light from all sides is multiplied with: base colour, or ka
    vec3 emissive;
    float f90;
    float alpha;     // opacity
    float metallic;
    float roughness;
    float occlusion;
    float exponent;    // n of `phong`
    float anisotropy;  // strength
};

// Fills in what the models of this program look at. Empirical models take the material's own kd, ks and n where no
// texture changes what they are derived from, else: kd = base (1 - metallic), ks = f0, 4 n = 2 / alpha^2 - 2.
void derive_reflectance(inout Surface s, MaterialData m, vec4 specular) {
#ifdef DEFAULT_SPECULAR  // no material of the scene has another index of refraction or specular colour
    s.f0 = mix(vec3(0.04), s.base_color, s.metallic);
    s.f90 = 1.0;
#else
    vec3 dielectric = min(m.extra.x * specular.rgb, 1.0) * specular.a;
    s.f0 = mix(dielectric, s.base_color, s.metallic);
    s.f90 = mix(specular.a, 1.0, s.metallic);
#endif
    s.diffuse = s.base_color * (1.0 - s.metallic);
    s.ambient = s.base_color;
#if SHADING == SHADING_PHONG || SHADING == SHADING_BLINN_PHONG
#ifdef HAS_METALLIC_ROUGHNESS_TEXTURE
    float alpha = max(s.roughness * s.roughness, 0.001);
    s.exponent = 0.5 / (alpha * alpha) - 0.5;
#else
    // The texture multiplies kd and ka; of ks it changes the metallic part.
    vec3 textured = s.base_color / max(m.base_color.rgb, 1e-6);
    s.diffuse = m.phong_diffuse.rgb * textured;
    s.f0 = m.phong_specular.rgb + (s.base_color - m.base_color.rgb) * s.metallic;
    s.ambient = m.phong_ambient.rgb * textured;
    s.exponent = m.phong_diffuse.w;
#endif
#endif
}
