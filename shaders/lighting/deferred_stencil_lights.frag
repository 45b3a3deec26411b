// One local light on the pixels of a G-buffer that the stencil lets through.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>

uniform int light;  // the scene's index
out vec4 radiance;

void main() {
    Surface s;
    radiance = vec4(0.0);  // no discard: the stencil must be wiped here too
    if (surface_at(ivec2(gl_FragCoord.xy), s) && s.lit > 0.0) {
        radiance.rgb = min(terms_of(reflected_light(s, light)), LARGEST);
    }
}
