// Lights the pixels of a G-buffer that pass the stencil test, with one point or spot light.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>
#include "light_outputs.glsl"

uniform int light;  // index in the scene

void main() {
    Surface s;
    write_background(vec4(0.0));  // no discard, because the stencil must be reset here, too
    if (surface_at(ivec2(gl_FragCoord.xy), SAMPLE_INDEX, s) && s.lit > 0.0) write_direct(s, direct_lighting(s, light));
}
