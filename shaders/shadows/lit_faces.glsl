// A caster's triangle with its three neighbours in world space, and which of them face the light.
#include "extruded.glsl"

layout(triangles_adjacency) in;
in vec3 g_position[];
flat in int g_way[];
flat in float g_handedness[];

bool before(vec3 a, vec3 b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

// Whether a triangle faces the light. Each is asked about from four sides, and rounding must be the same from all of
// them: it is computed from its least corner on.
bool lit(vec3 a, vec3 b, vec3 c) {
    vec3 first = before(b, a) && before(b, c) ? b : before(c, a) && before(c, b) ? c : a;
    vec3 second = first == a ? b : first == b ? c : a;
    vec3 third = first == a ? c : first == b ? a : b;
    vec4 light = light_place();
    precise vec3 along = second - first, up = third - first, to_light = light.xyz - first * light.w;
    precise vec3 normal = vec3(
        along.y * up.z - along.z * up.y, along.z * up.x - along.x * up.z, along.x * up.y - along.y * up.x
    );
    precise float side = normal.x * to_light.x + normal.y * to_light.y + normal.z * to_light.z;
    return side * g_handedness[0] > 0.0;
}
