// Light that came from the vertices or the face; textures and shadows at every fragment.
#include <pass_view.glsl>
#include <textured_surface.glsl>
#include <terms.glsl>
#define DIRECTION in
#include "vertex_light_varyings.glsl"

uniform vec3 ambient;
#ifdef HAS_OCCLUSION
uniform sampler2D occlusion;
#endif
out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage

void main() {
    Surface s = surface_here(PASS_VIEW);
#ifdef HAS_OCCLUSION
    s.occlusion *= texelFetch(occlusion, ivec2(gl_FragCoord.xy), 0).r;
#endif
    Reflected light = Reflected(v_diffuse, v_specular);
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
        float lit = shadow(shadow_lights[k], s.position, s.geometric_normal);
        light.diffuse += v_shadowed_diffuse[k] * lit;
        light.specular += v_shadowed_specular[k] * lit;
    }
#endif
    light.diffuse *= s.diffuse;
    radiance = vec4(radiance_of(s, light, ambient) * s.alpha, s.alpha);
}
