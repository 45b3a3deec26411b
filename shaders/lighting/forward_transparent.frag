// Light at every fragment of a surface that shows what is behind it.
#include <pass_view.glsl>
#include <textured_surface.glsl>
#include <lighting.glsl>

uniform vec3 ambient;
out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage

void main() {
    Surface s = surface_here(PASS_VIEW);
    radiance = vec4(radiance_of(s, reflected_lights(s), ambient) * s.alpha, s.alpha);
}
