// Forward lighting, evaluated per fragment.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without the specular part
#endif

void main() {
    Surface s = fragment_surface(PASS_VIEW);
    ReflectedLight direct = direct_lighting(s), environment = environment_lighting(s);
    radiance = vec4(radiance_of(s, direct, environment) * s.alpha, s.alpha);
#ifdef WRITES_DIFFUSE
    diffuse = vec4(radiance_of(s, diffuse_only(direct), diffuse_only(environment)) * s.alpha, s.alpha);
#endif
}
