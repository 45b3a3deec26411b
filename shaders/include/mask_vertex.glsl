// What an alpha mask needs of a vertex, where there is one.
#ifdef ALPHA_MASK
#include <material_vertex.glsl>
#endif

void pass_mask_on() {
#ifdef ALPHA_MASK
    pass_material_on();
#endif
}
