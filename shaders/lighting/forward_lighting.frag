// Light at every fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without its specular part
#endif

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    ReflectedLight light = direct_lighting(s), around = environment_lighting(s);
    radiance = vec4(radiance_of(s, light, around) * s.alpha, s.alpha);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, diffuse_only(light), diffuse_only(around)) * s.alpha, s.alpha);
#endif
}
