// Projects a caster's vertices along the light's rays onto the receiver's plane. Vertices behind the plane or behind
// the light are clipped.
#include <mask_vertex.glsl>
#include <transform.glsl>

struct PlanarProjection {
    mat4 matrix;
    vec4 plane;  // positive on the light's side
};
layout(std430) readonly buffer projections {
    PlanarProjection planar_projections[];
};
uniform int layer;

const float MIN_HEIGHT = 1e-4;  // metres: geometry in the plane casts no shadow on it

void main() {
    PlanarProjection projection = planar_projections[layer];
    write_alpha_mask_varyings();
    vec3 position = object_to_world(in_position);
    float height = dot(projection.plane, vec4(position, 1.0));
    vec4 projected = projection.matrix * vec4(position, 1.0);
    gl_Position = PASS_VIEW.view_projection * projected;
    gl_ClipDistance[0] = height - MIN_HEIGHT;
    gl_ClipDistance[1] = projected.w;
}
