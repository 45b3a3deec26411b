// Forward lighting with light computed per vertex or per face. Textures and shadows are evaluated per fragment.
#define NO_LAYERS
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <radiance.glsl>
#define DIRECTION in
#include "vertex_light_varyings.glsl"
#include "light_outputs.glsl"
#include "caught_light.glsl"

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    ReflectedLight direct = ReflectedLight(v_diffuse, v_specular);
#ifdef HAS_ENVIRONMENT
    ReflectedLight environment = ReflectedLight(v_environment_diffuse, v_environment_specular);
#else
    ReflectedLight environment = environment_lighting(s);
#endif
    vec3 unshadowed = direct.diffuse + environment.diffuse;
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) unshadowed += v_shadowed_diffuse[k];
#endif
    begin_catcher(s, unshadowed);
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
        float light_visibility = shadow(shadow_lights[k], s.position, s.geometric_normal);
        direct.diffuse += v_shadowed_diffuse[k] * light_visibility;
        direct.specular += v_shadowed_specular[k] * light_visibility;
    }
#endif
#if defined(WRITES_IRRADIANCE) && (TERMS == TERMS_ALL || TERMS == TERMS_DIFFUSE)
    direct_irradiance = PI * direct.diffuse;
#endif
    direct.diffuse *= s.diffuse;
#ifdef HAS_SHADOW_CATCHER
    direct.specular = environment.specular = vec3(0.0);
#endif
    write_light(s, direct, environment);
    end_catcher(s, 1.0);
}
