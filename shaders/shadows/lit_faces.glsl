// A caster's triangle with its three adjacent vertices in world space, and the test whether a triangle faces the light.
#include "extrusion.glsl"

layout(triangles_adjacency) in;
in vec3 g_position[];
flat in int g_method[];
flat in float g_handedness[];

bool is_before(vec3 a, vec3 b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

// Whether a triangle faces the light. The triangle itself and the three neighbours that test it must get bit-identical
// results, so the computation has a fixed order, starting from the lexicographically smallest corner.
bool faces_light(vec3 a, vec3 b, vec3 c) {
    vec3 first = is_before(b, a) && is_before(b, c) ? b : is_before(c, a) && is_before(c, b) ? c : a;
    vec3 second = first == a ? b : first == b ? c : a;
    vec3 third = first == a ? c : first == b ? a : b;
    vec4 light = light_position();
    precise vec3 u = second - first, v = third - first, light_vector = light.xyz - first * light.w;
    precise vec3 normal = vec3(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x);
    precise float side = normal.x * light_vector.x + normal.y * light_vector.y + normal.z * light_vector.z;
    return side * g_handedness[0] > 0.0;
}
