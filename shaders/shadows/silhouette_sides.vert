// Sides of shadow volumes from silhouette edges found on the CPU: six vertices per edge.
#include "extrusion.glsl"

layout(std430) readonly buffer sides {
    vec4 edge_ends[];  // two per edge
};

void main() {
    int corner = int[](0, 1, 2, 2, 1, 3)[gl_VertexID % 6];
    vec3 position = edge_ends[gl_VertexID / 6 * 2 + corner % 2].xyz;
    gl_Position = corner < 2 ? to_clip(position) : extrude(position);
}
