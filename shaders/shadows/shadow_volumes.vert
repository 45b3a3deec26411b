// World-space vertices of the casters, and the counting method of each object's volume.
#include <transform.glsl>

in ivec2 in_ids;  // material, object
layout(std430) readonly buffer counting {
    int methods[];  // for each light, for each object: 0 no volume, 1 z-pass, 2 z-fail
};
uniform int first_method;  // of the light

out vec3 g_position;
flat out int g_method;
flat out float g_handedness;

void main() {
    g_position = object_to_world(in_position);
    g_method = methods[first_method + in_ids.y];
    g_handedness = handedness();
    gl_Position = vec4(g_position, 1.0);
}
