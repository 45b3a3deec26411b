// Light at every fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without its specular part
#endif

void main() {
    Surface s = surface_here(PASS_VIEW);
    Reflected light = reflected_lights(s), around = light_around(s);
    radiance = vec4(radiance_of(s, light, around) * s.alpha, s.alpha);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, without_specular(light), without_specular(around)) * s.alpha, s.alpha);
#endif
}
