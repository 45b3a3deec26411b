// Writes depth only, and discards fragments that the alpha mask cuts away.
#ifdef ALPHA_MASK
#include <alpha_mask.glsl>
#include <base_color.glsl>
flat in int v_material;
#endif

#ifdef WRITES_VELOCITY
#include <fragment_velocity.glsl>
out vec2 velocity;
#endif

void main() {
#ifdef ALPHA_MASK
    alpha_test(fragment_base_color(v_material).a, materials[MATERIAL_INDEX(v_material)].emissive.a);
#endif
#ifdef WRITES_VELOCITY
    velocity = fragment_velocity();
#endif
}
