// Forward lighting by one light, to be added to the others. The first pass adds emission and environment lighting.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
#include "light_outputs.glsl"
#include "caught_light.glsl"

#ifndef FIRST_PASS
uniform int light;  // index in the scene
#endif

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    begin_catcher(s, UNSHADOWED_LIGHT(s));
#ifdef FIRST_PASS
    write_light(s, ReflectedLight(vec3(0.0), vec3(0.0)), environment_lighting(s));
    end_catcher(s, 1.0);
#else
    write_direct(s, direct_lighting(s, light));
    end_catcher(s, 0.0);
#endif
}
