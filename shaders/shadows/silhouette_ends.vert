// Ends of shadow volumes over lit faces that the CPU has found: six vertices a face, of it and of its image far away.
#include "extruded.glsl"

layout(std430) readonly buffer faces {
    vec4 face_corners[];  // three a face
};

void main() {
    int corner = gl_VertexID % 6;
    vec3 position = face_corners[gl_VertexID / 6 * 3 + int[](0, 1, 2, 0, 2, 1)[corner]].xyz;
    bool drawn = corner < 3 ? COUNTED == Z_FAIL : has_far_end();
    gl_Position = !drawn ? vec4(0.0) : corner < 3 ? clip_of(position) : extruded(position);
}
