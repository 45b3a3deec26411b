// The nearest blended surface behind the layer before, lit (C. Everitt, "Interactive Order-Independent Transparency",
// 2001). The fixed function's depth test finds the nearest of what is let through.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
#include <per_sample.glsl>

uniform SAMPLER_2D depth;  // of opaque surfaces
#ifdef PEELED
uniform SAMPLER_2D before;  // of the layer before
#endif
out vec4 layer;  // scene-linear, premultiplied; alpha is opacity

void main() {
    Surface s = fragment_surface(PASS_VIEW);  // first: it takes derivatives, for which neighbours have to be there
    ivec2 texel = ivec2(gl_FragCoord.xy);
    if (nearer(texelFetch(depth, texel, SAMPLE_INDEX).r, gl_FragCoord.z)) discard;
#ifdef PEELED
    if (!nearer(texelFetch(before, texel, SAMPLE_INDEX).r, gl_FragCoord.z)) discard;
#endif
    layer = vec4(radiance_of(s, direct_lighting(s), environment_lighting(s)) * s.alpha, s.alpha);
}
