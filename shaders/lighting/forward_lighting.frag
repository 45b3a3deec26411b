// Light at every fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage

void main() {
    Surface s = surface_here(PASS_VIEW);
    radiance = vec4(radiance_of(s, reflected_lights(s)) * s.alpha, s.alpha);
}
