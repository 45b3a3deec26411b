// Where the objects were in the previous frame, for steps that read an input of `SceneData`.
#include <scene.glsl>

layout(std430) readonly buffer scene_previous_block {
    float scene_previous[];  // 14 for each instance: the three rows of its matrix, and two that are not used
};

#ifdef SCENE_POSED
layout(std430) readonly buffer scene_previous_position_block {
    float scene_previous_positions[];  // object-space positions of the vertices in the previous frame, 3 floats each
};
#endif

// Object-space position of a vertex in the previous frame, in metres.
vec3 scene_previous_vertex_position(int vertex) {
#ifdef SCENE_POSED
    int at = 3 * vertex;
    return vec3(scene_previous_positions[at], scene_previous_positions[at + 1], scene_previous_positions[at + 2]);
#else
    return scene_vertex_position(vertex);
#endif
}

// World-space position of a point of a triangle in the previous frame.
vec3 scene_previous_position(int instance, int triangle, vec2 barycentrics) {
    ivec3 v = scene_triangle(instance, triangle);
    vec3 w = scene_weights(barycentrics);
    mat3 corners = mat3(
        scene_previous_vertex_position(v.x),
        scene_previous_vertex_position(v.y),
        scene_previous_vertex_position(v.z));
    vec4 point = vec4(corners * w, 1.0);
    vec3 previous;
    for (int row = 0; row < 3; ++row) {
        int at = 14 * instance + 4 * row;
        previous[row] = dot(
            vec4(scene_previous[at], scene_previous[at + 1], scene_previous[at + 2], scene_previous[at + 3]), point);
    }
    return previous;
}
