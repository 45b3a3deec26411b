// Counts fragments by additive blending. Fragments that fail the alpha test are not counted.
#ifdef ALPHA_MASK
#include <alpha_mask.glsl>
#include <base_color.glsl>
flat in int v_material;
#endif

out float count;

void main() {
#ifdef ALPHA_MASK
    alpha_test(fragment_base_color(v_material).a, materials[MATERIAL_INDEX(v_material)].emissive.a);
#endif
    count = 1.0;
}
