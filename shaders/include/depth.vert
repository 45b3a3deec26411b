// Transforms positions only, with the varyings of an alpha mask where the material has one.
#include <mask_vertex.glsl>
#include <transform.glsl>

void main() {
    write_alpha_mask_varyings();
    write_velocity_varyings();
    gl_Position = world_to_clip(object_to_world(in_position));
}
