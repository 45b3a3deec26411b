// Base colour and alpha of a fragment: material factor × texture × vertex colour.
#include <materials.glsl>
#include <material_texel.glsl>
#include <texture_coordinates.glsl>

#ifdef HAS_VERTEX_COLOR
centroid in vec4 v_color;
#endif
#ifdef HAS_BASE_COLOR_TEXTURE
uniform sampler2D base_color_texture;
#endif

// Base colour and alpha of this fragment, scene-linear, before any alpha test. `material` is `v_material`.
vec4 fragment_base_color(int material) {
    vec4 color = materials[MATERIAL_INDEX(material)].base_color;
#ifdef HAS_BASE_COLOR_TEXTURE
    color *= material_texel(base_color_texture, slot_uv(material, BASE_COLOR_SLOT, UV_SET(BASE_COLOR_UV)));
#endif
#ifdef HAS_VERTEX_COLOR
    color *= v_color;
#endif
    return color;
}
