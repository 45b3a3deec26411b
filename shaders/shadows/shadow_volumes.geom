// The part of a shadow volume that belongs to one triangle: nothing where it is turned away from the light; else a side
// at each edge behind which the surface is, and the triangle itself and its image far away as ends.
#include "lit_faces.glsl"

layout(triangle_strip, max_vertices = 18) out;

void emit(vec4 position) {
    gl_Position = position;
    EmitVertex();
}

void main() {
    if (g_way[0] != COUNTED) return;
    vec3 corners[3] = vec3[](g_position[0], g_position[2], g_position[4]);
    vec3 beyond[3] = vec3[](g_position[1], g_position[3], g_position[5]);
    if (!lit(corners[0], corners[1], corners[2])) return;

    vec4 here[3], there[3];
    for (int i = 0; i < 3; ++i) {
        here[i] = clip_of(corners[i]);
        there[i] = extruded(corners[i]);
    }
    bool turned = g_handedness[0] < 0.0;  // a mirrored object's corners run the other way round
    for (int i = 0; i < 3; ++i) {
        int next = (i + 1) % 3;
        if (lit(corners[next], corners[i], beyond[i])) continue;
        int start = turned ? next : i, stop = turned ? i : next;
        emit(here[stop]);
        emit(here[start]);
        emit(there[stop]);
        emit(there[start]);
        EndPrimitive();
    }
    int second = turned ? 2 : 1, third = turned ? 1 : 2;
#if COUNTED == Z_FAIL
    emit(here[0]);
    emit(here[second]);
    emit(here[third]);
    EndPrimitive();
#endif
    if ((COUNTED == Z_FAIL || length_of_sides > 0.0) && has_far_end()) {
        emit(there[0]);
        emit(there[third]);
        emit(there[second]);
        EndPrimitive();
    }
}
