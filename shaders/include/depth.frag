// Depth alone; fragments that an alpha mask cuts away are dropped.
#ifdef ALPHA_MASK
#include <base_color.glsl>
flat in int v_material;
#endif

void main() {
#ifdef ALPHA_MASK
    if (base_color_at(v_material).a < materials[MATERIAL_INDEX(v_material)].emissive.a) discard;
#endif
}
