// The scene as data, for steps that read an input of `SceneData`: from an instance, a triangle of it and barycentrics
// to positions, normals and the `Surface` that geometry passes shade. An instance is an object of the scene, with the
// same number. Triangles are numbered within their mesh, as in `gl_PrimitiveID` of a geometry pass. Barycentrics are
// the weights of the triangle's second and third vertex.
#include <material_surface.glsl>
#include <math.glsl>
#include <surface.glsl>

struct SceneVertex {
    float position[3];
    float normal[3];
#ifdef SCENE_TANGENTS_STREAM
    float tangent[4];
#endif
#ifdef SCENE_UV0_STREAM
    float uv0[2];
#endif
#ifdef SCENE_UV1_STREAM
    float uv1[2];
#endif
#ifdef SCENE_COLORS_STREAM
    float color[4];
#endif
};

struct SceneInstance {
    vec4 rows[3];       // of the affine object-to-world matrix
    int material;       // number in `materials`
    int mesh;
    int flags;          // SCENE_CASTS_SHADOW and others
    int first_index;    // of its triangles in `scene_indices`
    int base_vertex;    // is added to those indices
    int triangles;
    int first_emitter;  // the number of its triangle 0 in `scene_emitters`; -1 if it emits no light
    int padding;
    vec4 box_center;    // xyz: middle of its world-space bounding box
    vec4 box_extent;    // xyz: half of the box's sides
};

// What a geometry step draws of one object, for its `commands`.
struct DrawCommand {
    uint count;
    uint instances;
    uint first_index;
    int base_vertex;
    uint base_instance;
};

// A triangle that emits light, in this frame or another. Those of an instance follow each other in their own order.
struct SceneEmitter {
    int instance;
    int triangle;
};

#ifdef SCENE_TEXTURES
// Of each material its 8 slots: array (-1 without a texture), layer, width | height << 16, and bits: UV set, 2 without
// filtering, 4 and 16 times the wrap mode along s and t (0 repeat, 1 mirror, 2 clamp).
layout(std430) readonly buffer scene_texture_block {
    ivec4 scene_textures[];
};
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
#if SCENE_ARRAY_COUNT > 5
uniform sampler2DArray scene_array_5;
#endif

layout(std430) readonly buffer scene_vertex_block {
    SceneVertex scene_vertices[];
};
layout(std430) readonly buffer scene_index_block {
    uint scene_indices[];
};
layout(std430) readonly buffer scene_instance_block {
    SceneInstance scene_instances[];  // SCENE_INSTANCE_COUNT
};
layout(std430) readonly buffer scene_emitter_block {
    SceneEmitter scene_emitters[];  // SCENE_EMITTER_COUNT
};

// Whether an instance has a `flag`: SCENE_CASTS_SHADOW, SCENE_MIRRORED, …
bool scene_has(int instance, int flag) {
    return (scene_instances[instance].flags & flag) != 0;
}

// The command that draws an instance, or nothing where `is_drawn` is false.
DrawCommand scene_draw_command(int instance, bool is_drawn) {
    SceneInstance i = scene_instances[instance];
    return DrawCommand(uint(3 * i.triangles), is_drawn ? 1u : 0u, uint(i.first_index), i.base_vertex, uint(instance));
}

// The numbers of a triangle's vertices in `scene_vertices`.
ivec3 scene_triangle(int instance, int triangle) {
    SceneInstance i = scene_instances[instance];
    int first = i.first_index + 3 * triangle;
    return i.base_vertex + ivec3(scene_indices[first], scene_indices[first + 1], scene_indices[first + 2]);
}

// Object-space position of a vertex, in metres.
vec3 scene_vertex_position(int vertex) {
    float p[3] = scene_vertices[vertex].position;
    return vec3(p[0], p[1], p[2]);
}

// Object-space unit normal of a vertex.
vec3 scene_vertex_normal(int vertex) {
    float n[3] = scene_vertices[vertex].normal;
    return vec3(n[0], n[1], n[2]);
}

// Object-space tangent of a vertex, and the bitangent's sign in w.
vec4 scene_vertex_tangent(int vertex) {  // 0 where the mesh has none
#ifdef SCENE_TANGENTS_STREAM
    float t[4] = scene_vertices[vertex].tangent;
    return vec4(t[0], t[1], t[2], t[3]);
#else
    return vec4(0.0);
#endif
}

// Texture coordinates of a vertex; `set` is 0 or 1.
vec2 scene_vertex_uv(int vertex, int set) {  // 0 where the mesh has none
    vec2 uv = vec2(0.0);
#ifdef SCENE_UV0_STREAM
    if (set == 0) uv = vec2(scene_vertices[vertex].uv0[0], scene_vertices[vertex].uv0[1]);
#endif
#ifdef SCENE_UV1_STREAM
    if (set == 1) uv = vec2(scene_vertices[vertex].uv1[0], scene_vertices[vertex].uv1[1]);
#endif
    return uv;
}

// Colour of a vertex, linear RGB and alpha.
vec4 scene_vertex_color(int vertex) {  // white where the mesh has none
#ifdef SCENE_COLORS_STREAM
    float c[4] = scene_vertices[vertex].color;
    return vec4(c[0], c[1], c[2], c[3]);
#else
    return vec4(1.0);
#endif
}

// World-space position of an object-space `point` of an instance.
vec3 scene_point_to_world(int instance, vec3 point) {
    vec4 rows[3] = scene_instances[instance].rows;
    vec4 p = vec4(point, 1.0);
    return vec3(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
}

// World-space vector of an object-space `direction` of an instance; not normalized.
vec3 scene_direction_to_world(int instance, vec3 direction) {
    vec4 rows[3] = scene_instances[instance].rows;
    return vec3(dot(rows[0].xyz, direction), dot(rows[1].xyz, direction), dot(rows[2].xyz, direction));
}

// As `normal_to_world()` of `transform.glsl`: the cofactor matrix, with the sign of the determinant.
vec3 scene_normal_to_world(int instance, vec3 normal) {
    vec4 rows[3] = scene_instances[instance].rows;
#ifdef UNIFORM_SCALE
    return scene_direction_to_world(instance, normal);
#else
    vec3 c0 = cross(rows[1].xyz, rows[2].xyz), c1 = cross(rows[2].xyz, rows[0].xyz);
    vec3 c2 = cross(rows[0].xyz, rows[1].xyz);
    vec3 world = vec3(dot(c0, normal), dot(c1, normal), dot(c2, normal)) * sign(dot(rows[0].xyz, c0));
    return world * inversesqrt(max(dot(world, world), 1e-30));
#endif
}

// Weights of a triangle's three vertices at a point.
vec3 scene_weights(vec2 barycentrics) {
    return vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics);
}

// World-space corners of a triangle, as columns.
mat3 scene_corners(int instance, int triangle) {
    ivec3 v = scene_triangle(instance, triangle);
    return mat3(
        scene_point_to_world(instance, scene_vertex_position(v.x)),
        scene_point_to_world(instance, scene_vertex_position(v.y)),
        scene_point_to_world(instance, scene_vertex_position(v.z)));
}

// World-space position of a point of a triangle.
vec3 scene_position(int instance, int triangle, vec2 barycentrics) {
    return scene_corners(instance, triangle) * scene_weights(barycentrics);
}

// Barycentrics of a world-space point in the plane of a triangle.
vec2 scene_barycentrics(int instance, int triangle, vec3 position) {
    mat3 p = scene_corners(instance, triangle);
    vec3 a = p[1] - p[0], b = p[2] - p[0], offset = position - p[0];
    vec3 normal = cross(a, b);
    return vec2(dot(cross(offset, b), normal), dot(cross(a, offset), normal)) / max(dot(normal, normal), 1e-37);
}

// Unit normal of a triangle on its front side, where it runs counter-clockwise; of mirrored objects where it runs
// clockwise, as their winding is reversed.
vec3 scene_geometric_normal(int instance, int triangle) {
    mat3 p = scene_corners(instance, triangle);
    vec3 normal = cross(p[1] - p[0], p[2] - p[0]);
    normal *= inversesqrt(max(dot(normal, normal), 1e-37));
    return scene_has(instance, SCENE_MIRRORED) ? -normal : normal;
}

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
// A texture coordinate `u` from 0 to 1, as the wrap `mode` of a sampler has it: 0 repeats, 1 mirrors, 2 clamps.
float scene_wrapped(float u, int mode) {
    float mirrored = 1.0 - abs(mod(u, 2.0) - 1.0);
    return mode == 0 ? fract(u) : mode == 1 ? mirrored : clamp(u, 0.0, 1.0);
}

// The texel of a slot at level 0 as its sampler has it, at the coordinates `c`; false if the material or the mesh lacks
// it. `arrays` are the arrays that textures of the slot lie in, a constant. The border of a layer holds what lies
// across the image's edges.
bool scene_texel(int instance, int slot, int arrays, SceneCoordinates c, out vec4 texel) {
    int material = MATERIAL_INDEX(scene_instances[instance].material);
    ivec4 entry = scene_textures[material * 8 + slot];
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
#if SCENE_ARRAY_COUNT > 5
    SCENE_SAMPLE(5, scene_array_5)
#endif
#undef SCENE_SAMPLE
    return true;
}
#endif

// Base colour and alpha: material factor × texture × vertex colour, with `v` and `w` as above and the coordinates `c`.
vec4 scene_base_color(int instance, ivec3 v, vec3 w, SceneCoordinates c) {
    vec4 color = materials[MATERIAL_INDEX(scene_instances[instance].material)].base_color;
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

// As `tangent_frame()` of `fragment_surface.glsl`: the mesh's own tangents, else along the texture coordinates of the
// normal map. `v`, `w` and `corners` are the triangle's vertices, their weights and their world-space positions.
void scene_tangent_frame(
    int instance, ivec3 v, vec3 w, mat3 corners, vec3 normal, out vec3 tangent, out vec3 bitangent) {
#ifdef SCENE_TANGENTS_STREAM
    if (scene_has(instance, SCENE_HAS_TANGENTS)) {
        vec4 local =
            scene_vertex_tangent(v.x) * w.x + scene_vertex_tangent(v.y) * w.y + scene_vertex_tangent(v.z) * w.z;
        tangent = normalize(scene_direction_to_world(instance, local.xyz));
        bitangent = cross(normal, tangent) * (scene_has(instance, SCENE_MIRRORED) ? -local.w : local.w);
        return;
    }
#endif
    int set = 0;
#ifdef SCENE_NORMAL_ARRAYS
    set = scene_textures[MATERIAL_INDEX(scene_instances[instance].material) * 8 + NORMAL_SLOT].w & 1;
#endif
    vec2 uv = scene_vertex_uv(v.x, set);
    vec2 uv_a = scene_vertex_uv(v.y, set) - uv, uv_b = scene_vertex_uv(v.z, set) - uv;
    uv_tangent_frame(
        normal, corners[1] - corners[0], corners[2] - corners[0], uv_a, uv_b, tangent, bitangent);
}

// Everything a shading model reads: the surface that a geometry pass shades there, seen along -view_dir. Nothing is
// discarded: `scene_alpha` is compared with the material's cutoff by the caller, where there is SCENE_MASKED.
Surface scene_surface(int instance, int triangle, vec2 barycentrics, vec3 view_dir) {
    int flags = scene_instances[instance].flags;
    MaterialData m = materials[MATERIAL_INDEX(scene_instances[instance].material)];
    ivec3 v = scene_triangle(instance, triangle);
    vec3 w = scene_weights(barycentrics);
    mat3 corners = scene_corners(instance, triangle);
    SceneCoordinates c = scene_coordinates(v, w);
    Surface s;
    s.position = corners * w;
    s.view_dir = view_dir;
    vec3 front = scene_geometric_normal(instance, triangle);
    bool is_front = dot(front, view_dir) >= 0.0;
    s.geometric_normal = is_front ? front : -front;

    vec4 base = scene_base_color(instance, v, w, c);
    s.base_color = base.rgb;
    s.alpha = (flags & SCENE_BLENDED) != 0 ? base.a : 1.0;

    vec3 normal = scene_normal_to_world(instance, scene_vertex_normal(v.x)) * w.x;
    normal += scene_normal_to_world(instance, scene_vertex_normal(v.y)) * w.y;
    normal += scene_normal_to_world(instance, scene_vertex_normal(v.z)) * w.z;
    s.normal = normalize(normal);

    MaterialTexels texels = no_texels();
#ifdef SCENE_TEXTURES
    vec4 texel;
#endif
#ifdef SCENE_METALLIC_ROUGHNESS_ARRAYS
    texels.has_metallic_roughness =
        scene_texel(instance, METALLIC_ROUGHNESS_SLOT, SCENE_METALLIC_ROUGHNESS_ARRAYS, c, texel);
    texels.metallic_roughness = texel.rgb;
#endif
#ifdef SCENE_SPECULAR_ARRAYS
    if (scene_texel(instance, SPECULAR_SLOT, SCENE_SPECULAR_ARRAYS, c, texel)) texels.specular.a = texel.a;
#endif
#ifdef SCENE_SPECULAR_COLOR_ARRAYS
    if (scene_texel(instance, SPECULAR_COLOR_SLOT, SCENE_SPECULAR_COLOR_ARRAYS, c, texel)) {
        texels.specular.rgb = texel.rgb;
    }
#endif
#ifdef SCENE_NORMAL_ARRAYS
    texels.has_normal = scene_texel(instance, NORMAL_SLOT, SCENE_NORMAL_ARRAYS, c, texel);
    texels.normal = texel.xyz;
#endif
#if defined(SCENE_ANISOTROPY_ARRAYS) && defined(NEEDS_GRAIN)
    texels.has_anisotropy = scene_texel(instance, ANISOTROPY_SLOT, SCENE_ANISOTROPY_ARRAYS, c, texel);
    texels.anisotropy = texel.rgb;
#endif
#ifdef SCENE_OCCLUSION_ARRAYS
    texels.has_occlusion = scene_texel(instance, OCCLUSION_SLOT, SCENE_OCCLUSION_ARRAYS, c, texel);
    texels.occlusion = texel.r;
#endif
#ifdef SCENE_EMISSIVE_ARRAYS
    if (scene_texel(instance, EMISSIVE_SLOT, SCENE_EMISSIVE_ARRAYS, c, texel)) texels.emissive = texel.rgb;
#endif
#ifdef NEEDS_GRAIN
    bool needs_frame = true;
#else
    bool needs_frame = texels.has_normal;
#endif
    if (needs_frame) scene_tangent_frame(instance, v, w, corners, s.normal, s.tangent, s.bitangent);
    bool flip_normal = !is_front && (flags & SCENE_DOUBLE_SIDED) != 0;
    material_surface(s, m, texels, flip_normal, (flags & SCENE_UNLIT) == 0);
    return s;
}
