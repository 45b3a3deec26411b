// Positions in the world, for a geometry shader that sees them from every view, and what an alpha mask needs.
#include "layered_names.glsl"
#include <mask_vertex.glsl>
#include <transform.glsl>

void main() {
    write_alpha_mask_varyings();
    gl_Position = vec4(object_to_world(in_position), 1.0);
}
