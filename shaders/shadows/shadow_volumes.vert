// Casters' vertices in world space, and which way their volumes are counted.
#include <transform.glsl>

in ivec2 in_ids;  // material, object
layout(std430) readonly buffer counting {
    int ways[];  // for each light, for each object: 0 not at all, 1 z-pass, 2 z-fail
};
uniform int first_way;  // the light's

out vec3 g_position;
flat out int g_way;
flat out float g_handedness;

void main() {
    g_position = object_to_world(in_position);
    g_way = ways[first_way + in_ids.y];
    g_handedness = handedness();
    gl_Position = vec4(g_position, 1.0);
}
