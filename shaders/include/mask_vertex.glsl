// Varyings that an alpha mask needs, if the material has one.
#ifdef ALPHA_MASK
#include <material_vertex.glsl>
#endif

// Writes the varyings of the material where an alpha mask is tested, and nothing elsewhere.
void write_alpha_mask_varyings() {
#ifdef ALPHA_MASK
    write_material_varyings();
#endif
}
