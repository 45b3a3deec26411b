// The buffers of the scene as data: vertices, instances and emitting triangles. Vertices and instances are fetched as
// texels, because software rasterisers fetch those in a third of the time of elements of a storage block.
struct SceneInstance {
    vec4 rows[3];       // of the affine object-to-world matrix
    int material;       // number in `materials`
    int mesh;
    int flags;          // SCENE_CASTS_SHADOW and others
    int first_index;    // of its triangles in `scene_indices`
    int base_vertex;    // added to those indices
    int triangles;
    int first_emitter;  // the number of its triangle 0 in `scene_emitters`; -1 if it emits no light
    int padding;
    vec4 box_center;    // xyz: middle of its world-space bounding box
    vec4 box_extent;    // xyz: half of the box's sides
};

// The command with which a geometry step draws one object, for its `commands`.
struct DrawCommand {
    uint count;
    uint instances;
    uint first_index;
    int base_vertex;
    uint base_instance;
};

// A triangle that emits light, in this frame or another. Those of an instance are consecutive and keep their order.
struct SceneEmitter {
    int instance;
    int triangle;
};

uniform samplerBuffer scene_vertex_texels;     // SCENE_VERTEX_ROWS per vertex: position, normal, streams
uniform isamplerBuffer scene_instance_texels;  // `scene_instances`, followed by the textures of materials
layout(std430) readonly buffer scene_index_block {
    uint scene_indices[];
};
layout(std430) readonly buffer scene_instance_block {
    SceneInstance scene_instances[];  // SCENE_INSTANCE_COUNT
};
layout(std430) readonly buffer scene_emitter_block {
    SceneEmitter scene_emitters[];  // SCENE_EMITTER_COUNT
};

const int SCENE_INSTANCE_ROWS = 7;

// The record of an instance, as in `scene_instances`.
SceneInstance scene_instance(int instance) {
    int at = SCENE_INSTANCE_ROWS * instance;
    vec4 matrix[3], box[2];
    for (int row = 0; row < 3; ++row) matrix[row] = intBitsToFloat(texelFetch(scene_instance_texels, at + row));
    ivec4 a = texelFetch(scene_instance_texels, at + 3), b = texelFetch(scene_instance_texels, at + 4);
    for (int row = 0; row < 2; ++row) box[row] = intBitsToFloat(texelFetch(scene_instance_texels, at + 5 + row));
    return SceneInstance(matrix, a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, box[0], box[1]);
}

// Whether an instance has a `flag`: SCENE_CASTS_SHADOW, SCENE_MIRRORED, …
bool scene_has(int instance, int flag) {
    return (scene_instance(instance).flags & flag) != 0;
}

// The command that draws an instance, or nothing if `is_drawn` is false.
DrawCommand scene_draw_command(int instance, bool is_drawn) {
    SceneInstance i = scene_instance(instance);
    return DrawCommand(uint(3 * i.triangles), is_drawn ? 1u : 0u, uint(i.first_index), i.base_vertex, uint(instance));
}

// The numbers of a triangle's vertices.
ivec3 scene_triangle(int instance, int triangle) {
    SceneInstance i = scene_instance(instance);
    int first = i.first_index + 3 * triangle;
    return i.base_vertex + ivec3(scene_indices[first], scene_indices[first + 1], scene_indices[first + 2]);
}

// Four floats of a `vertex`, from the even number `first` on.
vec4 scene_vertex_floats(int vertex, int first) {
    int row = vertex * SCENE_VERTEX_ROWS + first / 4;
    vec4 floats = texelFetch(scene_vertex_texels, row);
    return first % 4 == 0 ? floats : vec4(floats.zw, texelFetch(scene_vertex_texels, row + 1).xy);
}

// Object-space position of a vertex, in metres.
vec3 scene_vertex_position(int vertex) {
    return texelFetch(scene_vertex_texels, vertex * SCENE_VERTEX_ROWS).xyz;
}

// Object-space unit normal of a vertex.
vec3 scene_vertex_normal(int vertex) {
    int row = vertex * SCENE_VERTEX_ROWS;
    return vec3(texelFetch(scene_vertex_texels, row).w, texelFetch(scene_vertex_texels, row + 1).xy);
}

// Object-space tangent of a vertex, and the bitangent's sign in w.
vec4 scene_vertex_tangent(int vertex) {  // 0 where the mesh has none
#ifdef SCENE_TANGENTS_STREAM
    return scene_vertex_floats(vertex, SCENE_TANGENTS_STREAM);
#else
    return vec4(0.0);
#endif
}

// Texture coordinates of a vertex; `set` is 0 or 1.
vec2 scene_vertex_uv(int vertex, int set) {  // 0 where the mesh has none
    vec2 uv = vec2(0.0);
#ifdef SCENE_UV0_STREAM
    if (set == 0) uv = scene_vertex_floats(vertex, SCENE_UV0_STREAM).xy;
#endif
#ifdef SCENE_UV1_STREAM
    if (set == 1) uv = scene_vertex_floats(vertex, SCENE_UV1_STREAM).xy;
#endif
    return uv;
}

// Colour of a vertex, linear RGB and alpha.
vec4 scene_vertex_color(int vertex) {  // white where the mesh has none
#ifdef SCENE_COLORS_STREAM
    return scene_vertex_floats(vertex, SCENE_COLORS_STREAM);
#else
    return vec4(1.0);
#endif
}
