// Varyings that an alpha mask needs, if the material has one.
#ifdef ALPHA_MASK
#include <material_vertex.glsl>
#endif

void write_alpha_mask_varyings() {
#ifdef ALPHA_MASK
    write_material_varyings();
#endif
}
