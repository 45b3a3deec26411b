// Forward lighting by one light, to be added to the others. The first pass adds emission and environment lighting.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

#ifndef FIRST_PASS
uniform int light;  // the scene's index
#endif
out vec4 radiance;  // scene-linear; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without the specular part
#endif

void main() {
    Surface s = fragment_surface(PASS_VIEW);
#ifdef FIRST_PASS
    ReflectedLight direct = ReflectedLight(vec3(0.0), vec3(0.0)), environment = environment_lighting(s);
    radiance = vec4(radiance_of(s, direct, environment), 1.0);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, direct, diffuse_only(environment)), 1.0);
#endif
#else
    ReflectedLight direct = direct_lighting(s, light);
    radiance = vec4(min(selected_terms(direct), MAX_HALF_FLOAT), 0.0);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(min(selected_terms(diffuse_only(direct)), MAX_HALF_FLOAT), 0.0);
#endif
#endif
}
