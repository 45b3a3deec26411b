// The surface of a fragment of the scene's geometry, from varyings, material factors and textures.
#include <alpha_mask.glsl>
#include <base_color.glsl>
#include <math.glsl>
#include <surface.glsl>

in vec3 v_position;
#if PASS_SAMPLES > 1
centroid in vec4 v_centroid_position;  // v_position and 1, interpolated at the centroid, which lies on the surface
#endif
centroid in vec3 v_normal;
flat in int v_material;

#if defined(HAS_NORMAL_TEXTURE) || defined(NEEDS_GRAIN)
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
    // From the derivatives of position and texture coordinates (Schueler 2013).
    vec2 uv = UV_SET(NORMAL_UV);
    vec3 position_dx = dFdx(v_position), position_dy = dFdy(v_position);
    vec2 uv_dx = dFdx(uv), uv_dy = dFdy(uv);
    vec3 perpendicular_dx = cross(position_dy, normal), perpendicular_dy = cross(normal, position_dx);
    tangent = perpendicular_dx * uv_dx.x + perpendicular_dy * uv_dy.x;
    bitangent = -(perpendicular_dx * uv_dx.y + perpendicular_dy * uv_dy.y);
    float longest = max(dot(tangent, tangent), dot(bitangent, bitangent));
    float shortest = min(dot(tangent, tangent), dot(bitangent, bitangent));
    if (shortest < max(1e-30, 1e-12 * longest)) {  // no usable texture coordinates: any frame will do
        tangent = any_tangent(normal);
        bitangent = cross(normal, tangent);
    } else {
        tangent *= inversesqrt(longest);
        bitangent *= inversesqrt(longest);
    }
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

    s.metallic = m.surface.x;
    s.roughness = m.surface.y;
#ifdef HAS_METALLIC_ROUGHNESS_TEXTURE
    vec2 uv = slot_uv(v_material, METALLIC_ROUGHNESS_SLOT, UV_SET(METALLIC_ROUGHNESS_UV));
    vec3 texel = texture(metallic_roughness_texture, uv).rgb;
    s.metallic *= texel.b;
    s.roughness *= texel.g;
#endif

    vec4 specular = m.specular;
#ifdef HAS_SPECULAR_TEXTURE
    specular.a *= texture(specular_texture, slot_uv(v_material, SPECULAR_SLOT, UV_SET(SPECULAR_UV))).a;
#endif
#ifdef HAS_SPECULAR_COLOR_TEXTURE
    specular.rgb *=
        texture(specular_color_texture, slot_uv(v_material, SPECULAR_COLOR_SLOT, UV_SET(SPECULAR_COLOR_UV))).rgb;
#endif

    s.normal = normalize(v_normal);
#ifdef NEEDS_TANGENT
    tangent_frame(s.normal, s.tangent, s.bitangent);
#endif
#ifdef HAS_NORMAL_TEXTURE
    vec2 normal_uv = slot_uv(v_material, NORMAL_SLOT, UV_SET(NORMAL_UV));
    vec3 tangent_normal = texture(normal_texture, normal_uv).xyz * 2.0 - 1.0;
    tangent_normal.xy *= m.surface.w;
    s.normal = normalize(mat3(s.tangent, s.bitangent, s.normal) * tangent_normal);
#endif
#ifdef NEEDS_GRAIN
    s.anisotropy = m.extra.y;
    vec2 grain = vec2(cos(m.extra.z), sin(m.extra.z));  // direction in the tangent plane
#ifdef HAS_ANISOTROPY_TEXTURE
    vec2 anisotropy_uv = slot_uv(v_material, ANISOTROPY_SLOT, UV_SET(ANISOTROPY_UV));
    vec3 anisotropy = texture(anisotropy_texture, anisotropy_uv).rgb;
    grain = mat2(grain.x, grain.y, -grain.y, grain.x) * (anisotropy.rg * 2.0 - 1.0);
    s.anisotropy *= anisotropy.b;
#endif
    s.tangent = normalize(s.tangent) * grain.x + normalize(s.bitangent) * grain.y;
    s.tangent = normalize(s.tangent - s.normal * dot(s.normal, s.tangent));
    s.bitangent = cross(s.normal, s.tangent);
#endif
#ifdef DOUBLE_SIDED
    if (!gl_FrontFacing) s.normal = -s.normal;
#endif

    s.lit = 1.0;
#ifdef UNLIT
    s.lit = 0.0;
#endif
    s.occlusion = 1.0;
#ifdef HAS_OCCLUSION_TEXTURE
    float occlusion = texture(occlusion_texture, slot_uv(v_material, OCCLUSION_SLOT, UV_SET(OCCLUSION_UV))).r;
    s.occlusion += m.surface.z * (occlusion - 1.0);
#endif
    s.emissive = m.emissive.rgb;
#ifdef NO_EMISSIVE  // no material of the scene is emissive
    s.emissive = vec3(0.0);
#endif
#ifdef HAS_EMISSIVE_TEXTURE
    s.emissive *= texture(emissive_texture, slot_uv(v_material, EMISSIVE_SLOT, UV_SET(EMISSIVE_UV))).rgb;
#endif
    derive_reflectance(s, m, specular);
#ifdef ALPHA_MASK
    alpha_test(s.alpha, m.emissive.a);
#endif
#ifndef ALPHA_BLEND
    s.alpha = 1.0;
#endif
    return s;
}
