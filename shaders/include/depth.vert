// Positions alone, and what an alpha mask needs where there is one.
#include <mask_vertex.glsl>
#include <transform.glsl>

void main() {
    pass_mask_on();
    pass_motion_on();
    gl_Position = world_to_clip(object_to_world(in_position));
}
