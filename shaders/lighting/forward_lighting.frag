// Forward lighting, evaluated per fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
#include "light_outputs.glsl"

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    ReflectedLight direct = direct_lighting(s), environment = environment_lighting(s);
    write_light(s, direct, environment);
}
