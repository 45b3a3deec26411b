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

bool scene_has(int instance, int flag) {
    return (scene_instances[instance].flags & flag) != 0;
}

// The command that draws an instance, or nothing.
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

vec3 scene_vertex_position(int vertex) {
    float p[3] = scene_vertices[vertex].position;
    return vec3(p[0], p[1], p[2]);
}

vec3 scene_vertex_normal(int vertex) {
    float n[3] = scene_vertices[vertex].normal;
    return vec3(n[0], n[1], n[2]);
}

vec4 scene_vertex_tangent(int vertex) {  // 0 where the mesh has none
#ifdef SCENE_TANGENTS_STREAM
    float t[4] = scene_vertices[vertex].tangent;
    return vec4(t[0], t[1], t[2], t[3]);
#else
    return vec4(0.0);
#endif
}

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

vec4 scene_vertex_color(int vertex) {  // white where the mesh has none
#ifdef SCENE_COLORS_STREAM
    float c[4] = scene_vertices[vertex].color;
    return vec4(c[0], c[1], c[2], c[3]);
#else
    return vec4(1.0);
#endif
}

vec3 scene_point_to_world(int instance, vec3 point) {
    vec4 rows[3] = scene_instances[instance].rows;
    vec4 p = vec4(point, 1.0);
    return vec3(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
}

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

// Base colour and alpha: material factor × texture × vertex colour.
vec4 scene_base_color(int instance, int triangle, vec2 barycentrics) {
    vec4 color = materials[MATERIAL_INDEX(scene_instances[instance].material)].base_color;
#ifdef SCENE_COLORS_STREAM
    ivec3 v = scene_triangle(instance, triangle);
    vec3 w = scene_weights(barycentrics);
    color *= scene_vertex_color(v.x) * w.x + scene_vertex_color(v.y) * w.y + scene_vertex_color(v.z) * w.z;
#endif
    return color;
}

// Opacity before any alpha test: material factor × texture × vertex colour.
float scene_alpha(int instance, int triangle, vec2 barycentrics) {
    return scene_base_color(instance, triangle, barycentrics).a;
}

// Everything a shading model reads: the surface that a geometry pass shades there, seen along -view_dir. Nothing is
// discarded: `scene_alpha` is compared with the material's cutoff by the caller, where there is SCENE_MASKED.
Surface scene_surface(int instance, int triangle, vec2 barycentrics, vec3 view_dir) {
    int material = scene_instances[instance].material, flags = scene_instances[instance].flags;
    MaterialData m = materials[MATERIAL_INDEX(material)];
    ivec3 v = scene_triangle(instance, triangle);
    vec3 w = scene_weights(barycentrics);
    mat3 corners = scene_corners(instance, triangle);
    Surface s;
    s.position = corners * w;
    s.view_dir = view_dir;
    vec3 front = scene_geometric_normal(instance, triangle);
    bool is_front = dot(front, view_dir) >= 0.0;
    s.geometric_normal = is_front ? front : -front;

    vec4 base = scene_base_color(instance, triangle, barycentrics);
    s.base_color = base.rgb;
    s.alpha = (flags & SCENE_BLENDED) != 0 ? base.a : 1.0;

    vec3 normal = scene_normal_to_world(instance, scene_vertex_normal(v.x)) * w.x;
    normal += scene_normal_to_world(instance, scene_vertex_normal(v.y)) * w.y;
    normal += scene_normal_to_world(instance, scene_vertex_normal(v.z)) * w.z;
    s.normal = normalize(normal);

    MaterialTexels texels = no_texels();
#ifdef NEEDS_GRAIN
    s.tangent = any_tangent(s.normal);
    s.bitangent = cross(s.normal, s.tangent);
#endif
    bool flip_normal = !is_front && (flags & SCENE_DOUBLE_SIDED) != 0;
    material_surface(s, m, texels, flip_normal, (flags & SCENE_UNLIT) == 0);
    return s;
}
