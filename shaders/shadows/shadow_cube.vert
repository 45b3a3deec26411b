// World-space positions for a geometry shader that projects them into every view, and varyings of alpha masks.
#include "layered_varyings.glsl"
#include <mask_vertex.glsl>
#include <transform.glsl>

void main() {
    write_alpha_mask_varyings();
    gl_Position = vec4(object_to_world(in_position), 1.0);
}
