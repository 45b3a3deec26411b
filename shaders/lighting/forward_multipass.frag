// One light at every fragment, to be added to the others; in the first pass what needs no light.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

#ifndef FIRST_PASS
uniform int light;  // the scene's index
#endif
out vec4 radiance;  // scene-linear; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without its specular part
#endif

void main() {
    Surface s = surface_here(PASS_VIEW);
#ifdef FIRST_PASS
    Reflected none = Reflected(vec3(0.0), vec3(0.0)), around = light_around(s);
    radiance = vec4(radiance_of(s, none, around), 1.0);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, none, without_specular(around)), 1.0);
#endif
#else
    Reflected one = reflected_light(s, light);
    radiance = vec4(min(terms_of(one), LARGEST), 0.0);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(min(terms_of(without_specular(one)), LARGEST), 0.0);
#endif
#endif
}
