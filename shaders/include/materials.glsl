// The scene's materials.
struct MaterialData {
    vec4 base_color;
    vec4 emissive;        // rgb; w = alpha cutoff
    vec4 surface;         // metallic, roughness, occlusion strength, normal scale
    vec4 specular;        // rgb = specular colour; w = specular factor
    vec4 extra;           // dielectric f0, anisotropy strength, anisotropy rotation, 0
    vec4 phong_diffuse;   // rgb = kd; w = exponent n of `phong`
    vec4 phong_specular;  // rgb = ks
    vec4 phong_ambient;   // rgb = ka
#ifdef LAYERED_MATERIALS  // some material of the scene has a layer
    vec4 clearcoat;       // factor, roughness, normal scale, 0
    vec4 sheen;           // rgb = colour; w = roughness
    vec4 iridescence;     // factor, index of refraction, least and greatest thickness in nm
    vec4 transmission;    // factor, thickness, dispersion, index of refraction
    vec4 absorption;      // rgb = per metre of the volume
#endif
};

#ifdef MATERIAL_STORAGE
layout(std430) readonly buffer material_block {
    MaterialData materials[];
};
#else
layout(std140) uniform material_block {
    MaterialData materials[MATERIAL_COUNT];
};
#endif

#ifndef MATERIAL_SLOTS
#define MATERIAL_SLOTS 8  // texture slots per material; those of layers follow if a material has one
#endif
#ifdef HAS_UV_TRANSFORM  // two rows for each slot of a material: u' = a u + b v + c
#ifdef MATERIAL_UV_STORAGE
layout(std430) readonly buffer material_uv_block {
    vec4 material_uvs[];
};
#else
layout(std140) uniform material_uv_block {
    vec4 material_uvs[MATERIAL_COUNT * MATERIAL_SLOTS * 2];
};
#endif
#endif

const int BASE_COLOR_SLOT = 0;
const int METALLIC_ROUGHNESS_SLOT = 1;
const int NORMAL_SLOT = 2;
const int OCCLUSION_SLOT = 3;
const int EMISSIVE_SLOT = 4;
const int ANISOTROPY_SLOT = 5;
const int SPECULAR_SLOT = 6;
const int SPECULAR_COLOR_SLOT = 7;
const int CLEARCOAT_SLOT = 8;
const int CLEARCOAT_ROUGHNESS_SLOT = 9;
const int CLEARCOAT_NORMAL_SLOT = 10;
const int SHEEN_COLOR_SLOT = 11;
const int SHEEN_ROUGHNESS_SLOT = 12;
const int IRIDESCENCE_SLOT = 13;
const int IRIDESCENCE_THICKNESS_SLOT = 14;
const int TRANSMISSION_SLOT = 15;
const int THICKNESS_SLOT = 16;

// With a single material its index is a constant, so the block is read once per draw.
#if MATERIAL_COUNT == 1
#define MATERIAL_INDEX(index) 0
#else
#define MATERIAL_INDEX(index) (index)
#endif

// Texture coordinates of a texture slot (BASE_COLOR_SLOT, …), with its KHR_texture_transform if the batch has one. `uv`
// are the mesh's own.
vec2 slot_uv(int material, int slot, vec2 uv) {
#ifdef HAS_UV_TRANSFORM
    vec4 u = material_uvs[(MATERIAL_INDEX(material) * MATERIAL_SLOTS + slot) * 2];
    vec4 v = material_uvs[(MATERIAL_INDEX(material) * MATERIAL_SLOTS + slot) * 2 + 1];
    return vec2(dot(u.xy, uv) + u.z, dot(v.xy, uv) + v.z);
#else
    return uv;
#endif
}
