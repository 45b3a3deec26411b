// Light at every fragment.
#include <pass_view.glsl>
#include <textured_surface.glsl>
#include <lighting.glsl>

uniform vec3 ambient;
#ifdef HAS_OCCLUSION
uniform sampler2D occlusion;
#endif
out vec4 radiance;  // scene-linear, premultiplied; alpha is coverage

void main() {
    Surface s = surface_here(PASS_VIEW);
#ifdef HAS_OCCLUSION
    s.occlusion *= texelFetch(occlusion, ivec2(gl_FragCoord.xy), 0).r;
#endif
    radiance = vec4(radiance_of(s, reflected_lights(s), ambient) * s.alpha, s.alpha);
}
