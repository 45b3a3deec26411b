// What a shading model knows of a point on a surface, whether it comes from geometry or from a G-buffer. NEEDS_PHONG
// and NEEDS_GRAIN are defined where the model says so; with NEEDS_GRAIN_WHERE_ANY the second where a material has one.
#if defined(NEEDS_GRAIN_WHERE_ANY) && (defined(ANISOTROPIC) || defined(HAS_GRAIN)) && !defined(NEEDS_GRAIN)
#define NEEDS_GRAIN
#endif
#ifdef MATERIAL_COUNT
#include <materials.glsl>
#endif

struct Surface {
    vec3 position;
    vec3 normal;            // unit, for shading
    vec3 geometric_normal;  // unit, of the triangle, towards the viewer
    vec3 view_dir;         // unit
    vec3 tangent;           // unit, along the grain; with NEEDS_GRAIN, as the anisotropic model has it
    vec3 bitangent;
    vec3 base_color;
    vec3 diffuse;    // base colour without its metallic part; kd with NEEDS_PHONG, as the empirical models have it
    vec3 f0;         // specular colour at normal incidence, or ks
    vec3 ambient;    // what an even light from all sides is multiplied with: base colour, or ka
    vec3 emissive;
    vec4 dielectric;  // f0 and f90 of what is not metal
    float f90;
    float alpha;     // opacity
    float metallic;
    float roughness;
    float occlusion;
    float exponent;    // n of `phong`; with NEEDS_PHONG
    float anisotropy;  // strength; with NEEDS_GRAIN
    float lit;         // 0 where the material is unlit, else 1
};

// Reflectance from base colour, metallic part and, in `dielectric`, the rest's colour at normal and brightness at
// grazing incidence.
void physical_reflectance(inout Surface s, vec4 dielectric) {
    s.diffuse = s.base_color * (1.0 - s.metallic);
    s.ambient = s.base_color;
    s.f0 = mix(dielectric.rgb, s.base_color, s.metallic);
    s.f90 = mix(dielectric.a, 1.0, s.metallic);
}

// The exponent of `phong` that draws about the same highlight: 4 n = 2 / alpha^2 - 2.
float phong_exponent(float roughness) {
    float alpha = max(roughness * roughness, 0.001);
    return 0.5 / (alpha * alpha) - 0.5;
}

#ifdef MATERIAL_COUNT
vec4 dielectric_of(MaterialData m, vec4 specular) {
#ifdef DEFAULT_SPECULAR  // no material of the scene has another index of refraction or specular colour
    return vec4(0.04, 0.04, 0.04, 1.0);
#else
    return vec4(min(m.extra.x * specular.rgb, 1.0) * specular.a, specular.a);
#endif
}

// The empirical models' coefficients, after the physical ones: the material's own kd, ks and ka where no texture
// changes what they are derived from, else kd = base (1 - metallic), ks = f0.
void empirical_reflectance(inout Surface s, MaterialData m) {
    s.exponent = phong_exponent(s.roughness);
#ifndef HAS_METALLIC_ROUGHNESS_TEXTURE
    // The texture multiplies kd and ka; of ks it changes the metallic part.
    vec3 textured = s.base_color / max(m.base_color.rgb, 1e-6);
    s.diffuse = m.phong_diffuse.rgb * textured;
    s.f0 = m.phong_specular.rgb + (s.base_color - m.base_color.rgb) * s.metallic;
    s.ambient = m.phong_ambient.rgb * textured;
    s.exponent = m.phong_diffuse.w;
#endif
}

// Fills in what the models of this program look at.
void derive_reflectance(inout Surface s, MaterialData m, vec4 specular) {
    s.dielectric = dielectric_of(m, specular);
    physical_reflectance(s, s.dielectric);
#ifdef NEEDS_PHONG
    empirical_reflectance(s, m);
#endif
}
#endif
