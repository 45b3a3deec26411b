// A line at each silhouette edge, between a face that faces the light and one that does not.
#include "lit_faces.glsl"

layout(line_strip, max_vertices = 6) out;

void emit(vec3 corner) {
    gl_Position = to_clip(corner);
    gl_Position.z += 1e-4 * gl_Position.z;  // slightly in front of the faces
    EmitVertex();
}

void main() {
    if (g_method[0] != METHOD) return;
    vec3 corners[3] = vec3[](g_position[0], g_position[2], g_position[4]);
    vec3 adjacent[3] = vec3[](g_position[1], g_position[3], g_position[5]);
    if (!faces_light(corners[0], corners[1], corners[2])) return;
    for (int i = 0; i < 3; ++i) {
        int next = (i + 1) % 3;
        if (faces_light(corners[next], corners[i], adjacent[i])) continue;
        emit(corners[i]);
        emit(corners[next]);
        EndPrimitive();
    }
}
