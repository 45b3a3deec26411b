// A line at each edge between a face that the light meets and one that it does not.
#include "lit_faces.glsl"

layout(line_strip, max_vertices = 6) out;

void emit(vec3 corner) {
    gl_Position = clip_of(corner);
    gl_Position.z += 1e-4 * gl_Position.z;  // a little nearer than the faces it lies on
    EmitVertex();
}

void main() {
    if (g_way[0] != COUNTED) return;
    vec3 corners[3] = vec3[](g_position[0], g_position[2], g_position[4]);
    vec3 beyond[3] = vec3[](g_position[1], g_position[3], g_position[5]);
    if (!lit(corners[0], corners[1], corners[2])) return;
    for (int i = 0; i < 3; ++i) {
        int next = (i + 1) % 3;
        if (lit(corners[next], corners[i], beyond[i])) continue;
        emit(corners[i]);
        emit(corners[next]);
        EndPrimitive();
    }
}
