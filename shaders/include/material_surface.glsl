// Computes everything that a shading model reads from a material, its texels and a tangent frame. Geometry passes
// (`fragment_surface.glsl`) and the scene's data (`scene.glsl`) share this code.
#include <math.glsl>
#include <surface.glsl>

// Texels of a material at one point, all except the base colour; a factor of 1 where there is no texture.
struct MaterialTexels {
    vec3 metallic_roughness;
    vec4 specular;    // rgb = specular colour; a = specular factor
    vec3 normal;      // in tangent space, 0 to 1
    vec3 anisotropy;  // direction, 0 to 1; strength
    float occlusion;
    vec3 emissive;
    bool has_metallic_roughness;
    bool has_normal;
    bool has_anisotropy;
    bool has_occlusion;
};

// Texels that leave a material's own values unchanged, for materials without textures.
MaterialTexels no_texels() {
    return MaterialTexels(
        vec3(1.0), vec4(1.0), vec3(0.5, 0.5, 1.0), vec3(1.0, 0.5, 1.0), 1.0, vec3(1.0), false, false, false, false);
}

// Tangent along the rows of the normal map and bitangent up its columns, of equal length, at most 1, from the
// differences of position (`position_a`, `position_b`) and of texture coordinates (`uv_a`, `uv_b`) along two directions
// of the surface, a and b (Schueler 2013). Any two directions of a triangle give the same frame, seen from either side.
void uv_tangent_frame(
    vec3 normal, vec3 position_a, vec3 position_b, vec2 uv_a, vec2 uv_b, out vec3 tangent, out vec3 bitangent) {
    vec3 perpendicular_a = cross(position_b, normal), perpendicular_b = cross(normal, position_a);
    tangent = perpendicular_a * uv_a.x + perpendicular_b * uv_b.x;
    bitangent = -(perpendicular_a * uv_a.y + perpendicular_b * uv_b.y);
    float longest = max(dot(tangent, tangent), dot(bitangent, bitangent));
    float shortest = min(dot(tangent, tangent), dot(bitangent, bitangent));
    if (shortest < max(1e-30, 1e-12 * longest)) {  // no usable texture coordinates: any frame will do
        tangent = any_tangent(normal);
        bitangent = cross(normal, tangent);
    } else {
        float scale = inversesqrt(longest);
        if (dot(normal, cross(position_a, position_b)) < 0.0) scale = -scale;
        tangent *= scale;
        bitangent *= scale;
    }
}

// Completes a surface that has its position, view_dir, base colour and alpha, and the interpolated normal with the
// tangent frame: `tangent` and `bitangent` are read where there is a normal map, and with NEEDS_GRAIN. `texels` are
// those of the material's textures; `flip_normal` reverses the normal, for the back of a double-sided material; `lit`
// is false for unlit materials.
void material_surface(inout Surface s, MaterialData m, MaterialTexels texels, bool flip_normal, bool lit) {
    s.metallic = m.surface.x * texels.metallic_roughness.b;
    s.roughness = m.surface.y * texels.metallic_roughness.g;
    if (texels.has_normal) {
        vec3 tangent_normal = texels.normal * 2.0 - 1.0;
        tangent_normal.xy *= m.surface.w;
        s.normal = normalize(mat3(s.tangent, s.bitangent, s.normal) * tangent_normal);
    }
#ifdef NEEDS_GRAIN
    s.anisotropy = m.extra.y;
    vec2 grain = vec2(cos(m.extra.z), sin(m.extra.z));  // direction in the tangent plane
    if (texels.has_anisotropy) {
        grain = mat2(grain.x, grain.y, -grain.y, grain.x) * (texels.anisotropy.rg * 2.0 - 1.0);
        s.anisotropy *= texels.anisotropy.b;
    }
    s.tangent = normalize(s.tangent) * grain.x + normalize(s.bitangent) * grain.y;
    s.tangent = normalize(s.tangent - s.normal * dot(s.normal, s.tangent));
    s.bitangent = cross(s.normal, s.tangent);
#endif
    if (flip_normal) s.normal = -s.normal;

    s.lit = lit ? 1.0 : 0.0;
    s.occlusion = 1.0;
    if (texels.has_occlusion) s.occlusion += m.surface.z * (texels.occlusion - 1.0);
    s.emissive = m.emissive.rgb;
#ifdef NO_EMISSIVE  // no material of the scene is emissive
    s.emissive = vec3(0.0);
#endif
    s.emissive *= texels.emissive;
    derive_reflectance(s, m, m.specular * texels.specular, texels.has_metallic_roughness);
}
