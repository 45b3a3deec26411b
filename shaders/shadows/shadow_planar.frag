// Shadows the receiver, except where the caster's alpha mask cuts it away.
#ifdef ALPHA_MASK
#include <alpha_mask.glsl>
#include <base_color.glsl>
flat in int v_material;
#endif

out vec4 visibility;

void main() {
#ifdef ALPHA_MASK
    alpha_test(fragment_base_color(v_material).a, materials[MATERIAL_INDEX(v_material)].emissive.a);
#endif
    visibility = vec4(0.0);
}
