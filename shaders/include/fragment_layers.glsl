// Texels of the layers of a fragment's material.
#include <layers.glsl>
#include <material_texel.glsl>
#include <texture_coordinates.glsl>

#if defined(HAS_CLEARCOAT_NORMAL_TEXTURE) && defined(CLEARCOAT_LAYER)
#define HAS_COAT_NORMAL
#define LAYER_TEXELS(s, m, material) layer_texels(material, m, s.normal, s.tangent, s.bitangent)
#else
#define LAYER_TEXELS(s, m, material) layer_texels(material, m, s.normal, vec3(0.0), vec3(0.0))
#endif
#ifdef TRANSMISSION_LAYER
flat in float v_scale;  // of the object
#define OBJECT_SCALE v_scale
#else
#define OBJECT_SCALE 1.0
#endif

#ifdef CLEARCOAT_LAYER
#ifdef HAS_CLEARCOAT_TEXTURE
uniform sampler2D clearcoat_texture;
#endif
#ifdef HAS_CLEARCOAT_ROUGHNESS_TEXTURE
uniform sampler2D clearcoat_roughness_texture;
#endif
#ifdef HAS_CLEARCOAT_NORMAL_TEXTURE
uniform sampler2D clearcoat_normal_texture;
#endif
#endif
#ifdef SHEEN_LAYER
#ifdef HAS_SHEEN_COLOR_TEXTURE
uniform sampler2D sheen_color_texture;
#endif
#ifdef HAS_SHEEN_ROUGHNESS_TEXTURE
uniform sampler2D sheen_roughness_texture;
#endif
#endif
#ifdef IRIDESCENCE_LAYER
#ifdef HAS_IRIDESCENCE_TEXTURE
uniform sampler2D iridescence_texture;
#endif
#ifdef HAS_IRIDESCENCE_THICKNESS_TEXTURE
uniform sampler2D iridescence_thickness_texture;
#endif
#endif
#ifdef TRANSMISSION_LAYER
#ifdef HAS_TRANSMISSION_TEXTURE
uniform sampler2D transmission_texture;
#endif
#ifdef HAS_THICKNESS_TEXTURE
uniform sampler2D thickness_texture;
#endif
#endif

#ifdef HAS_LAYERS
#define LAYER_TEXEL(sampler, slot, set) material_texel(sampler, slot_uv(material, slot, UV_SET(set)))

// The layers' texels at this fragment; the coat's normal is `normal` if it has no map of its own.
LayerTexels layer_texels(int material, MaterialData m, vec3 normal, vec3 tangent, vec3 bitangent) {
    LayerTexels layers = LayerTexels(vec2(1.0), vec4(1.0), vec2(1.0), vec2(1.0), normal);
#ifdef CLEARCOAT_LAYER
#ifdef HAS_CLEARCOAT_TEXTURE
    layers.clearcoat.x = LAYER_TEXEL(clearcoat_texture, CLEARCOAT_SLOT, CLEARCOAT_UV).r;
#endif
#ifdef HAS_CLEARCOAT_ROUGHNESS_TEXTURE
    layers.clearcoat.y = LAYER_TEXEL(clearcoat_roughness_texture, CLEARCOAT_ROUGHNESS_SLOT, CLEARCOAT_ROUGHNESS_UV).g;
#endif
#endif
#ifdef SHEEN_LAYER
#ifdef HAS_SHEEN_COLOR_TEXTURE
    layers.sheen.rgb = LAYER_TEXEL(sheen_color_texture, SHEEN_COLOR_SLOT, SHEEN_COLOR_UV).rgb;
#endif
#ifdef HAS_SHEEN_ROUGHNESS_TEXTURE
    layers.sheen.a = LAYER_TEXEL(sheen_roughness_texture, SHEEN_ROUGHNESS_SLOT, SHEEN_ROUGHNESS_UV).a;
#endif
#endif
#ifdef IRIDESCENCE_LAYER
#ifdef HAS_IRIDESCENCE_TEXTURE
    layers.iridescence.x = LAYER_TEXEL(iridescence_texture, IRIDESCENCE_SLOT, IRIDESCENCE_UV).r;
#endif
#ifdef HAS_IRIDESCENCE_THICKNESS_TEXTURE
    layers.iridescence.y =
        LAYER_TEXEL(iridescence_thickness_texture, IRIDESCENCE_THICKNESS_SLOT, IRIDESCENCE_THICKNESS_UV).g;
#endif
#endif
#ifdef TRANSMISSION_LAYER
#ifdef HAS_TRANSMISSION_TEXTURE
    layers.transmission.x = LAYER_TEXEL(transmission_texture, TRANSMISSION_SLOT, TRANSMISSION_UV).r;
#endif
#ifdef HAS_THICKNESS_TEXTURE
    layers.transmission.y = LAYER_TEXEL(thickness_texture, THICKNESS_SLOT, THICKNESS_UV).g;
#endif
#endif
#ifdef HAS_COAT_NORMAL
    vec3 bump = LAYER_TEXEL(clearcoat_normal_texture, CLEARCOAT_NORMAL_SLOT, CLEARCOAT_NORMAL_UV).xyz * 2.0 - 1.0;
    bump.xy *= m.clearcoat.z;
    layers.clearcoat_normal = normalize(mat3(tangent, bitangent, normal) * bump);
#endif
#ifdef DOUBLE_SIDED
    if (!gl_FrontFacing) layers.clearcoat_normal = -layers.clearcoat_normal;
#endif
    return layers;
}
#endif
