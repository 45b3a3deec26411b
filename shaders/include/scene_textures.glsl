// Textures of the scene as data: base colour, opacity and any slot of a material at a point of a triangle.
#include <materials.glsl>
#include <scene_triangles.glsl>

#ifdef SCENE_TEXTURES
uniform sampler2DArray scene_array_0;
#endif
#if SCENE_ARRAY_COUNT > 1
uniform sampler2DArray scene_array_1;
#endif
#if SCENE_ARRAY_COUNT > 2
uniform sampler2DArray scene_array_2;
#endif
#if SCENE_ARRAY_COUNT > 3
uniform sampler2DArray scene_array_3;
#endif
#if SCENE_ARRAY_COUNT > 4
uniform sampler2DArray scene_array_4;
#endif

// The two sets of texture coordinates at a point.
struct SceneCoordinates {
    vec2 uv[2];
};

// Texture coordinates at a point of the triangle of the vertices `v`, with the weights `w`.
SceneCoordinates scene_coordinates(ivec3 v, vec3 w) {
    SceneCoordinates c;
    for (int set = 0; set < 2; ++set) {
        c.uv[set] = scene_vertex_uv(v.x, set) * w.x + scene_vertex_uv(v.y, set) * w.y + scene_vertex_uv(v.z, set) * w.z;
    }
    return c;
}

#ifdef SCENE_TEXTURES
// The texture of a material's slot: array (-1 without a texture), layer, width | height << 16, and bits: UV set, 2
// without filtering, 4 and 16 times the wrap mode along s and t (0 repeat, 1 mirror, 2 clamp).
ivec4 scene_texture(int material, int slot) {
    int first = SCENE_INSTANCE_ROWS * SCENE_INSTANCE_COUNT;
    return texelFetch(scene_instance_texels, first + material * MATERIAL_SLOTS + slot);
}

// A texture coordinate `u`, wrapped to 0 to 1 by the `mode` of a sampler: 0 repeats, 1 mirrors, 2 clamps.
float scene_wrapped(float u, int mode) {
    float mirrored = 1.0 - abs(mod(u, 2.0) - 1.0);
    return mode == 0 ? fract(u) : mode == 1 ? mirrored : clamp(u, 0.0, 1.0);
}

// The texel of a slot at level 0, as its sampler returns it at the coordinates `c`; false if the material or the mesh
// lacks it. `arrays`, a constant, are the arrays that hold textures of the slot. The border of a layer holds the texels
// across the image's edges.
bool scene_texel(int instance, int slot, int arrays, SceneCoordinates c, out vec4 texel) {
    int material = MATERIAL_INDEX(scene_instance(instance).material);
    ivec4 entry = scene_texture(material, slot);
    int set = entry.w & 1;
    texel = vec4(1.0);
    if (entry.x < 0 || !scene_has(instance, set == 1 ? SCENE_HAS_UV1 : SCENE_HAS_UV0)) return false;
    vec2 uv = slot_uv(material, slot, c.uv[set]);
    vec2 size = vec2(entry.z & 0xFFFF, entry.z >> 16);
    vec2 at = size * vec2(scene_wrapped(uv.x, (entry.w >> 2) & 3), scene_wrapped(uv.y, (entry.w >> 4) & 3));
    if ((entry.w & 2) != 0) at = min(floor(at), size - 1.0) + 0.5;
    vec3 place = vec3(at + 1.0, entry.y);
#define SCENE_SAMPLE(number, array)                           \
    if ((arrays & (1 << number)) != 0 && entry.x == number) { \
        place.xy /= vec2(textureSize(array, 0).xy);           \
        texel = textureLod(array, place, 0.0);                \
    }
    SCENE_SAMPLE(0, scene_array_0)
#if SCENE_ARRAY_COUNT > 1
    SCENE_SAMPLE(1, scene_array_1)
#endif
#if SCENE_ARRAY_COUNT > 2
    SCENE_SAMPLE(2, scene_array_2)
#endif
#if SCENE_ARRAY_COUNT > 3
    SCENE_SAMPLE(3, scene_array_3)
#endif
#if SCENE_ARRAY_COUNT > 4
    SCENE_SAMPLE(4, scene_array_4)
#endif
#undef SCENE_SAMPLE
    return true;
}
#endif

// Base colour and alpha: material factor × texture × vertex colour, with `v` and `w` as above and the coordinates `c`.
vec4 scene_base_color(int instance, ivec3 v, vec3 w, SceneCoordinates c) {
    vec4 color = materials[MATERIAL_INDEX(scene_instance(instance).material)].base_color;
#ifdef SCENE_BASE_COLOR_ARRAYS
    vec4 texel;
    if (scene_texel(instance, BASE_COLOR_SLOT, SCENE_BASE_COLOR_ARRAYS, c, texel)) color *= texel;
#endif
#ifdef SCENE_COLORS_STREAM
    color *= scene_vertex_color(v.x) * w.x + scene_vertex_color(v.y) * w.y + scene_vertex_color(v.z) * w.z;
#endif
    return color;
}

// Opacity before any alpha test: material factor × texture × vertex colour.
float scene_alpha(int instance, int triangle, vec2 barycentrics) {
    ivec3 v = scene_triangle(instance, triangle);
    vec3 w = scene_weights(barycentrics);
    return scene_base_color(instance, v, w, scene_coordinates(v, w)).a;
}
