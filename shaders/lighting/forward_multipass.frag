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
    Surface s = fragment_surface(PASS_VIEW);
#ifdef FIRST_PASS
    ReflectedLight none = ReflectedLight(vec3(0.0), vec3(0.0)), around = environment_lighting(s);
    radiance = vec4(radiance_of(s, none, around), 1.0);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, none, diffuse_only(around)), 1.0);
#endif
#else
    ReflectedLight one = direct_lighting(s, light);
    radiance = vec4(min(selected_terms(one), MAX_HALF_FLOAT), 0.0);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(min(selected_terms(diffuse_only(one)), MAX_HALF_FLOAT), 0.0);
#endif
#endif
}
