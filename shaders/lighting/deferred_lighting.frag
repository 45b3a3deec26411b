// Light at every pixel of a G-buffer. With DIRECTIONALS_ONLY the other lights come later.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>

uniform vec3 background;
out vec4 radiance;  // scene-linear; alpha is coverage

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Surface s;
    if (!surface_at(texel, s)) {
        radiance = vec4(background, 0.0);
        return;
    }
    radiance = vec4(s.lit > 0.0 ? radiance_of(s, reflected_lights(s)) : unlit_radiance(s), 1.0);
}
