// The buffers of the scene as data, and what lies in them: vertices, instances and emitting triangles.
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
