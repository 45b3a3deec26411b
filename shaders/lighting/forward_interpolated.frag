// Light that came from the vertices or the face; textures and shadows at every fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <radiance.glsl>
#define DIRECTION in
#include "vertex_light_varyings.glsl"

out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without its specular part
#endif

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    ReflectedLight light = ReflectedLight(v_diffuse, v_specular);
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
        float lit = shadow(shadow_lights[k], s.position, s.geometric_normal);
        light.diffuse += v_shadowed_diffuse[k] * lit;
        light.specular += v_shadowed_specular[k] * lit;
    }
#endif
    light.diffuse *= s.diffuse;
#ifdef HAS_ENVIRONMENT
    ReflectedLight around = ReflectedLight(v_around_diffuse, v_around_specular);
#else
    ReflectedLight around = environment_lighting(s);
#endif
    radiance = vec4(radiance_of(s, light, around) * s.alpha, s.alpha);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, diffuse_only(light), diffuse_only(around)) * s.alpha, s.alpha);
#endif
}
