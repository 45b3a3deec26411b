// Forward lighting, evaluated per fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
#include "light_outputs.glsl"
#include "caught_light.glsl"

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    begin_catcher(s, UNSHADOWED_LIGHT(s));
    ReflectedLight direct = direct_lighting(s), environment = environment_lighting(s);
    write_light(s, direct, environment);
    end_catcher(s, 1.0);
}
