// One light at every fragment, to be added to the others; in the first pass what needs no light.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

#ifndef FIRST_PASS
uniform int light;  // the scene's index
#endif
out vec4 radiance;  // scene-linear; alpha is coverage

void main() {
    Surface s = surface_here(PASS_VIEW);
#ifdef FIRST_PASS
    radiance = vec4(radiance_of(s, Reflected(vec3(0.0), vec3(0.0))), 1.0);
#else
    radiance = vec4(min(terms_of(reflected_light(s, light)), LARGEST), 0.0);
#endif
}
