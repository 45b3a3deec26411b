// The surface of a fragment of the scene's geometry, from varyings, material factors and textures.
#ifndef NO_LAYERS  // shaders that do not light per fragment leave layers out
#define FRAGMENT_LAYERS
#endif
#include <alpha_mask.glsl>
#include <base_color.glsl>
#include <fragment_layers.glsl>
#include <material_surface.glsl>

in vec3 v_position;
#if PASS_SAMPLES > 1
centroid in vec4 v_centroid_position;  // v_position and 1, interpolated at the centroid, which lies on the surface
#endif
centroid in vec3 v_normal;
flat in int v_material;

#if defined(HAS_NORMAL_TEXTURE) || defined(NEEDS_GRAIN) || defined(HAS_COAT_NORMAL)
#define NEEDS_TANGENT
#ifdef HAS_TANGENT
centroid in vec4 v_tangent;
#endif
#endif
#ifdef HAS_METALLIC_ROUGHNESS_TEXTURE
uniform sampler2D metallic_roughness_texture;
#endif
#ifdef HAS_NORMAL_TEXTURE
uniform sampler2D normal_texture;
#endif
#ifdef HAS_OCCLUSION_TEXTURE
uniform sampler2D occlusion_texture;
#endif
#ifdef HAS_EMISSIVE_TEXTURE
uniform sampler2D emissive_texture;
#endif
#ifdef HAS_SPECULAR_TEXTURE
uniform sampler2D specular_texture;
#endif
#ifdef HAS_SPECULAR_COLOR_TEXTURE
uniform sampler2D specular_color_texture;
#endif
#if defined(HAS_ANISOTROPY_TEXTURE) && defined(NEEDS_GRAIN)
uniform sampler2D anisotropy_texture;
#endif
#ifdef NEEDS_TANGENT
#ifndef NORMAL_UV
#define NORMAL_UV 0
#endif

// Tangent along the rows of the normal map and bitangent up its columns, as in glTF.
void tangent_frame(vec3 normal, out vec3 tangent, out vec3 bitangent) {
#ifdef HAS_TANGENT
    tangent = normalize(v_tangent.xyz);
    bitangent = cross(normal, tangent) * v_tangent.w;
#else
    vec2 uv = UV_SET(NORMAL_UV);
    uv_tangent_frame(normal, dFdx(v_position), dFdy(v_position), dFdx(uv), dFdy(uv), tangent, bitangent);
#endif
}
#endif

// Everything a shading model reads. Fragments that the alpha mask cuts away are discarded here.
Surface fragment_surface(View view) {
    MaterialData m = materials[MATERIAL_INDEX(v_material)];
    Surface s;
#if PASS_SAMPLES > 1
    // llvmpipe interpolates at the centroid, but divides by the w of the pixel centre. The interpolated 1 undoes that.
    s.position = v_centroid_position.xyz / v_centroid_position.w;
#else
    s.position = v_position;
#endif
    s.view_dir = view_dir(view, s.position);
    vec3 geometric_normal = cross(dFdx(v_position), dFdy(v_position));  // x points right and y up: it faces the viewer
    s.geometric_normal = geometric_normal * inversesqrt(max(dot(geometric_normal, geometric_normal), 1e-37));

    vec4 base = fragment_base_color(v_material);
    s.base_color = base.rgb;
    s.alpha = base.a;

    MaterialTexels texels = no_texels();
#ifdef HAS_METALLIC_ROUGHNESS_TEXTURE
    vec2 uv = slot_uv(v_material, METALLIC_ROUGHNESS_SLOT, UV_SET(METALLIC_ROUGHNESS_UV));
    texels.metallic_roughness = material_texel(metallic_roughness_texture, uv).rgb;
    texels.has_metallic_roughness = true;
#endif
#ifdef HAS_SPECULAR_TEXTURE
    texels.specular.a = material_texel(specular_texture, slot_uv(v_material, SPECULAR_SLOT, UV_SET(SPECULAR_UV))).a;
#endif
#ifdef HAS_SPECULAR_COLOR_TEXTURE
    texels.specular.rgb =
        material_texel(specular_color_texture, slot_uv(v_material, SPECULAR_COLOR_SLOT, UV_SET(SPECULAR_COLOR_UV))).rgb;
#endif
    s.normal = normalize(v_normal);
#ifdef NEEDS_TANGENT
    tangent_frame(s.normal, s.tangent, s.bitangent);
#endif
#ifdef HAS_NORMAL_TEXTURE
    texels.normal = material_texel(normal_texture, slot_uv(v_material, NORMAL_SLOT, UV_SET(NORMAL_UV))).xyz;
    texels.has_normal = true;
#endif
#if defined(HAS_ANISOTROPY_TEXTURE) && defined(NEEDS_GRAIN)
    vec2 anisotropy_uv = slot_uv(v_material, ANISOTROPY_SLOT, UV_SET(ANISOTROPY_UV));
    texels.anisotropy = material_texel(anisotropy_texture, anisotropy_uv).rgb;
    texels.has_anisotropy = true;
#endif
#ifdef HAS_OCCLUSION_TEXTURE
    texels.occlusion = material_texel(occlusion_texture, slot_uv(v_material, OCCLUSION_SLOT, UV_SET(OCCLUSION_UV))).r;
    texels.has_occlusion = true;
#endif
#ifdef HAS_EMISSIVE_TEXTURE
    texels.emissive = material_texel(emissive_texture, slot_uv(v_material, EMISSIVE_SLOT, UV_SET(EMISSIVE_UV))).rgb;
#endif
#ifdef HAS_LAYERS
    LayerTexels layers = LAYER_TEXELS(s, m, v_material);
#endif
    bool flip_normal = false, lit = true;
#ifdef DOUBLE_SIDED
    flip_normal = !gl_FrontFacing;
#endif
#ifdef UNLIT
    lit = false;
#endif
    material_surface(s, m, texels, flip_normal, lit);
    share_energy(s);
#ifdef ALPHA_MASK
    alpha_test(s.alpha, m.emissive.a);
#endif
#ifndef ALPHA_BLEND
    s.alpha = 1.0;
#endif
#ifdef HAS_LAYERS
    material_layers(s, m, layers, OBJECT_SCALE);
#endif
    return s;
}
