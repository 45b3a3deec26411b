// The part of a shadow volume that one triangle generates. A triangle that faces the light emits a side quad at each
// silhouette edge, and for the caps itself and its extrusion. Other triangles emit nothing.
#include "lit_faces.glsl"

layout(triangle_strip, max_vertices = 18) out;

void emit(vec4 position) {
    gl_Position = position;
    EmitVertex();
}

void main() {
    if (g_method[0] != METHOD) return;
    vec3 corners[3] = vec3[](g_position[0], g_position[2], g_position[4]);
    vec3 adjacent[3] = vec3[](g_position[1], g_position[3], g_position[5]);
    if (!faces_light(corners[0], corners[1], corners[2])) return;

    vec4 near[3], far[3];
    for (int i = 0; i < 3; ++i) {
        near[i] = to_clip(corners[i]);
        far[i] = extrude(corners[i]);
    }
    bool is_mirrored = g_handedness[0] < 0.0;  // a mirrored object has the opposite winding order
    for (int i = 0; i < 3; ++i) {
        int next = (i + 1) % 3;
        if (faces_light(corners[next], corners[i], adjacent[i])) continue;
        int start = is_mirrored ? next : i, stop = is_mirrored ? i : next;
        emit(near[stop]);
        emit(near[start]);
        emit(far[stop]);
        emit(far[start]);
        EndPrimitive();
    }
    int second = is_mirrored ? 2 : 1, third = is_mirrored ? 1 : 2;
#if METHOD == Z_FAIL
    emit(to_cap(corners[0]));
    emit(to_cap(corners[second]));
    emit(to_cap(corners[third]));
    EndPrimitive();
#endif
    if ((METHOD == Z_FAIL || length_of_sides > 0.0) && has_far_cap()) {
        emit(far[0]);
        emit(far[third]);
        emit(far[second]);
        EndPrimitive();
    }
}
