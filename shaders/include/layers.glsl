// The layers of a material (KHR_materials_clearcoat, sheen, iridescence, transmission and volume) at a point: their
// values, their light, and how they attenuate the light below them. From the top: coat, sheen, base. A film, if there
// is one, sets the reflectance of the base. `surface.glsl` defines which layers exist; without layers, every function
// is the identity.
#include <surface.glsl>
#if defined(CLEARCOAT_LAYER) || defined(TRANSMISSION_LAYER)
#include <brdf.glsl>
#endif
#ifdef SHEEN_LAYER
#include <sheen.glsl>
#include <brdf_table.glsl>
#endif
#ifdef IRIDESCENCE_LAYER
#include <iridescence.glsl>
#endif

#ifdef HAS_LAYERS
// Texels of the layers' textures; 1 where there is no texture.
struct LayerTexels {
    vec2 clearcoat;  // factor, roughness
    vec4 sheen;      // colour, roughness
    vec2 iridescence;   // factor; position between the two thicknesses
    vec2 transmission;  // factor, thickness
    vec3 clearcoat_normal;  // of the coat in world space, unit
};

// Fills in the layers of an otherwise complete surface. `texels` always hold the coat's normal; `scale` is that of the
// object.
void material_layers(inout Surface s, MaterialData m, LayerTexels texels, float scale) {
    float NoV = clamp(dot(s.normal, s.view_dir), 0.0, 1.0);
#ifdef TRANSMISSION_LAYER
    s.transmission = m.transmission.x * texels.transmission.x * (1.0 - s.metallic);
    s.thickness = m.transmission.y * texels.transmission.y * scale;
    s.dispersion = m.transmission.z;
    s.ior = m.transmission.w;
    s.absorption = m.absorption.rgb;
    s.diffuse *= 1.0 - s.transmission;
    s.ambient *= 1.0 - s.transmission;
#endif
#ifdef IRIDESCENCE_LAYER
    s.iridescence = m.iridescence.x * texels.iridescence.x;
    s.film_ior = m.iridescence.y;
    s.film_thickness = mix(m.iridescence.z, m.iridescence.w, texels.iridescence.y);
    vec3 film = film_reflectance(s.film_ior, s.film_thickness, s.f0, NoV);
    s.film_f0 = mix(s.f0, schlick_f0(film, NoV), s.iridescence);
#endif
#ifdef TRANSMISSION_LAYER
#if !defined(TRANSMITS) && !defined(PASSES_LIGHT)  // no step provides the light behind
    // The surface, with all its reflections, is blended over what is behind it.
    float opacity = max(1.0 - s.transmission * (1.0 - fresnel_schlick(vec3(s.dielectric.r), 1.0, NoV).r), 1e-3);
    s.alpha *= opacity;
    s.diffuse /= opacity;
    s.emissive /= opacity;
    s.f0 /= opacity;
    s.f90 /= opacity;
#ifdef IRIDESCENCE_LAYER
    s.film_f0 /= opacity;
#endif
#endif
#endif
#ifdef SHEEN_LAYER
    s.sheen_color = m.sheen.rgb * texels.sheen.rgb;
    s.sheen_roughness = max(m.sheen.a * texels.sheen.a, LEAST_SHEEN_ROUGHNESS);
#endif
#ifdef CLEARCOAT_LAYER
    s.clearcoat = m.clearcoat.x * texels.clearcoat.x;
    s.clearcoat_roughness = m.clearcoat.y * texels.clearcoat.y;
    s.clearcoat_normal = texels.clearcoat_normal;
    s.emissive *= 1.0 - s.clearcoat * fresnel_schlick(vec3(0.04), 1.0, max(dot(s.clearcoat_normal, s.view_dir), 0.0)).r;
#endif
}

#ifdef SHEEN_LAYER
// Fraction of uniform light that white sheen reflects to a direction with this `cosine` to the normal, before it is
// limited to 1.
float sheen_albedo(Surface s, float cosine) {
    return 4.0 * textureLod(brdf_table, vec2(sqrt(clamp(cosine, 0.0, 1.0)), s.sheen_roughness), 0.0).z;
}

// Fraction of the light between the base and a direction that passes through sheen; `albedo` is that of white sheen.
float below_sheen(Surface s, float albedo) {
    return 1.0 - max(max(s.sheen_color.r, s.sheen_color.g), s.sheen_color.b) * min(albedo, 1.0);
}
#endif

#ifdef CLEARCOAT_LAYER
// Reflectance of the smooth coat, of ior 1.5, at this cosine.
float clearcoat_reflectance(Surface s, float cosine) {
    return s.clearcoat * fresnel_schlick(vec3(0.04), 1.0, clamp(cosine, 0.0, 1.0)).r;
}

// Fraction of light that passes through the coat from `light_dir` to the base and on to the viewer.
float below_clearcoat(Surface s, vec3 light_dir) {
    float to_light = clearcoat_reflectance(s, dot(s.clearcoat_normal, light_dir));
    return 1.0 - max(to_light, clearcoat_reflectance(s, dot(s.clearcoat_normal, s.view_dir)));
}
#endif
#endif
