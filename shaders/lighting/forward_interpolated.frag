// Light that came from the vertices or the face; textures and shadows at every fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <radiance.glsl>
#define DIRECTION in
#include "vertex_light_varyings.glsl"

out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage

void main() {
    Surface s = surface_here(PASS_VIEW);
    Reflected light = Reflected(v_diffuse, v_specular);
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
        float lit = shadow(shadow_lights[k], s.position, s.geometric_normal);
        light.diffuse += v_shadowed_diffuse[k] * lit;
        light.specular += v_shadowed_specular[k] * lit;
    }
#endif
    light.diffuse *= s.diffuse;
    radiance = vec4(radiance_of(s, light) * s.alpha, s.alpha);
}
