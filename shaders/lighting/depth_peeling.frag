// The nearest transparent surface behind the previous layer, lit (C. Everitt, "Interactive Order-Independent
// Transparency", 2001). The depth test selects the nearest of the fragments that are not discarded.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
#include <per_sample.glsl>

uniform SAMPLER_2D depth;  // of opaque surfaces
#ifdef PEELED
uniform SAMPLER_2D previous_depth;  // of the previous layer
#endif
out vec4 layer;  // scene-linear, premultiplied; alpha is opacity

void main() {
    Surface s = fragment_surface(PASS_VIEW);  // before any discard, because it takes derivatives
    ivec2 texel = ivec2(gl_FragCoord.xy);
    if (nearer(texelFetch(depth, texel, SAMPLE_INDEX).r, gl_FragCoord.z)) discard;
#ifdef PEELED
    if (!nearer(texelFetch(previous_depth, texel, SAMPLE_INDEX).r, gl_FragCoord.z)) discard;
#endif
#if PASS_SAMPLES > 1
    gl_FragDepth = gl_FragCoord.z;  // the rasteriser's depth of a sample may differ, and a layer would be peeled twice
#endif
    vec3 color = radiance_of(s, direct_lighting(s), environment_lighting(s));
    layer = vec4(through_air(s.position, color) * s.alpha, s.alpha);
}
