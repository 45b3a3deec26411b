// Sides of shadow volumes over silhouettes that the CPU has found: six vertices an edge.
#include "extruded.glsl"

layout(std430) readonly buffer sides {
    vec4 side_ends[];  // two an edge
};

void main() {
    int corner = int[](0, 1, 2, 2, 1, 3)[gl_VertexID % 6];
    vec3 position = side_ends[gl_VertexID / 6 * 2 + corner % 2].xyz;
    gl_Position = corner < 2 ? clip_of(position) : extruded(position);
}
