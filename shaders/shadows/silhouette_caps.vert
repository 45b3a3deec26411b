// Caps of shadow volumes from lit faces found on the CPU: six vertices per face, for the near and the far cap.
#include "extrusion.glsl"

layout(std430) readonly buffer faces {
    vec4 face_corners[];  // three per face
};

void main() {
    int corner = gl_VertexID % 6;
    vec3 position = face_corners[gl_VertexID / 6 * 3 + int[](0, 1, 2, 0, 2, 1)[corner]].xyz;
    bool is_drawn = corner < 3 ? METHOD == Z_FAIL : has_far_cap();
    gl_Position = !is_drawn ? vec4(0.0) : corner < 3 ? to_cap(position) : extrude(position);
}
