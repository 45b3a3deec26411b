// A caster's vertices where the light throws them on the receiver's plane; what lies behind the plane, or behind the
// light, is clipped.
#include <mask_vertex.glsl>
#include <transform.glsl>

struct Projection {
    mat4 onto;
    vec4 plane;  // above 0 on the light's side
};
layout(std430) readonly buffer projections {
    Projection all_projections[];
};
uniform int layer;

const float ON_IT = 1e-4;  // metres: what lies in the plane casts nothing on it

void main() {
    Projection p = all_projections[layer];
    write_alpha_mask_varyings();
    vec3 position = object_to_world(in_position);
    float height = dot(p.plane, vec4(position, 1.0));
    vec4 fallen = p.onto * vec4(position, 1.0);
    gl_Position = PASS_VIEW.view_projection * fallen;
    gl_ClipDistance[0] = height - ON_IT;
    gl_ClipDistance[1] = fallen.w;
}
