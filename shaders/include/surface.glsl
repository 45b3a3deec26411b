// The surface point that shading models read, from geometry or from a G-buffer. NEEDS_PHONG and NEEDS_GRAIN follow from
// the model's `#pragma needs`. With NEEDS_GRAIN_WHERE_ANY, NEEDS_GRAIN is defined only for anisotropic materials.
#if defined(NEEDS_GRAIN_WHERE_ANY) && !defined(NEEDS_GRAIN) && \
    (defined(ANISOTROPIC) || defined(HAS_GRAIN) || defined(SCENE_GRAIN))
#define NEEDS_GRAIN
#endif
#ifdef MATERIAL_COUNT
#include <materials.glsl>
#endif

#include <layer_macros.glsl>

struct Surface {
    vec3 position;
    vec3 normal;            // shading normal, unit
    vec3 geometric_normal;  // normal of the triangle, unit, facing the viewer
    vec3 view_dir;          // unit vector to the viewer
    vec3 tangent;           // unit, along the grain; only with NEEDS_GRAIN
    vec3 bitangent;
    vec3 base_color;
    vec3 diffuse;     // diffuse reflectance: base colour × (1 - metallic); kd with NEEDS_PHONG
    vec3 f0;          // specular reflectance at normal incidence; ks with NEEDS_PHONG
    vec3 ambient;     // reflectance of the constant ambient light: base colour; ka with NEEDS_PHONG
    vec3 emissive;
    vec4 dielectric;  // rgb = f0 and w = f90 of the dielectric part
    float f90;        // specular reflectance at grazing incidence
    float alpha;      // opacity
    float metallic;
    float roughness;
    float occlusion;
    float exponent;    // n of `phong`; only with NEEDS_PHONG
    float anisotropy;  // strength; only with NEEDS_GRAIN
    float lit;         // 0 if the material is unlit, else 1
#ifdef CLEARCOAT_LAYER
    float clearcoat;  // factor
    float clearcoat_roughness;
    vec3 clearcoat_normal;  // unit
#endif
#ifdef SHEEN_LAYER
    vec3 sheen_color;
    float sheen_roughness;
#endif
#ifdef IRIDESCENCE_LAYER
    float iridescence;  // factor
    float film_ior;
    float film_thickness;  // nm
    vec3 film_f0;  // the f0 that stands for the film in the direction of the viewer
#endif
#ifdef TRANSMISSION_LAYER
    float transmission;  // fraction of the light that enters and passes through
    float thickness;     // metres
    float ior;
    float dispersion;    // 20 / Abbe number
    vec3 absorption;     // per metre
#endif
};

// Derives the reflectance from base colour and metallic, and from f0 (rgb) and f90 (w) of the dielectric part.
void physical_reflectance(inout Surface s, vec4 dielectric) {
    s.diffuse = s.base_color * (1.0 - s.metallic);
    s.ambient = s.base_color;
    s.f0 = mix(dielectric.rgb, s.base_color, s.metallic);
    s.f90 = mix(dielectric.a, 1.0, s.metallic);
}

#if defined(DIFFUSE_LOBE) && !defined(NEEDS_PHONG) && !defined(NEEDS_NOTHING)
#if DIFFUSE_LOBE == DIFFUSE_LOBE_SHARED
#define SHARES_ENERGY
#include <brdf_table.glsl>
#endif
#endif

// Leaves to the diffuse lobe only the light that the specular lobe of the dielectric part does not reflect. The largest
// channel counts, so that coloured reflections do not tint the diffuse lobe (KHR_materials_specular).
void share_energy(inout Surface s) {
#ifdef SHARES_ENERGY
    float NoV = clamp(dot(s.normal, s.view_dir), 0.0, 1.0);
    vec3 specular = ggx_albedo(s.dielectric.rgb, s.dielectric.a, NoV, s.roughness);
    s.diffuse *= 1.0 - min(max(max(specular.r, specular.g), specular.b), 1.0);
#endif
}

// The Phong exponent n with about the same highlight as GGX at a `roughness` from 0 to 1: 4 n = 2 / alpha² - 2.
float phong_exponent(float roughness) {
    float alpha = max(roughness * roughness, 0.001);
    return 0.5 / (alpha * alpha) - 0.5;
}

#ifdef MATERIAL_COUNT
// f0 (rgb) and f90 (w) of a material's dielectric part; `specular` has its specular colour and, in w, its specular
// factor at this point.
vec4 dielectric_of(MaterialData m, vec4 specular) {
#ifdef DEFAULT_SPECULAR  // all materials have the default index of refraction and specular colour
    return vec4(0.04, 0.04, 0.04, 1.0);
#else
    return vec4(min(m.extra.x * specular.rgb, 1.0) * specular.a, specular.a);
#endif
}

#ifdef HAS_METALLIC_ROUGHNESS_TEXTURE
const bool BATCH_HAS_METALLIC_ROUGHNESS = true;
#else
const bool BATCH_HAS_METALLIC_ROUGHNESS = false;
#endif

// Coefficients of the empirical models: the material's own kd, ks and ka. With a metallic-roughness texture
// (`has_metallic_roughness`) they follow from the physical ones instead: kd = base colour × (1 - metallic), ks = f0.
void empirical_reflectance(inout Surface s, MaterialData m, bool has_metallic_roughness) {
    s.exponent = phong_exponent(s.roughness);
    if (has_metallic_roughness) return;
    // The base colour texture multiplies kd and ka, and changes the metallic part of ks.
    vec3 base_color_texel = s.base_color / max(m.base_color.rgb, 1e-6);
    s.diffuse = m.phong_diffuse.rgb * base_color_texel;
    s.f0 = m.phong_specular.rgb + (s.base_color - m.base_color.rgb) * s.metallic;
    s.ambient = m.phong_ambient.rgb * base_color_texel;
    s.exponent = m.phong_diffuse.w;
}

// The same, for the material of this batch.
void empirical_reflectance(inout Surface s, MaterialData m) {
    empirical_reflectance(s, m, BATCH_HAS_METALLIC_ROUGHNESS);
}

// Derives the reflectance that the shading model of this program reads from base colour, metallic and roughness.
// `specular` and `has_metallic_roughness` are as above.
void derive_reflectance(inout Surface s, MaterialData m, vec4 specular, bool has_metallic_roughness) {
    s.dielectric = dielectric_of(m, specular);
    physical_reflectance(s, s.dielectric);
#ifdef NEEDS_PHONG
    empirical_reflectance(s, m, has_metallic_roughness);
#endif
}

// The same for the material of this batch, with its `specular`.
void derive_reflectance(inout Surface s, MaterialData m, vec4 specular) {
    derive_reflectance(s, m, specular, BATCH_HAS_METALLIC_ROUGHNESS);
}
#endif
