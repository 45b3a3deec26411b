// The nearest blended surface behind the layer before, lit (C. Everitt, "Interactive Order-Independent Transparency",
// 2001). The fixed function's depth test finds the nearest of what is let through.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
#include <each_sample.glsl>

uniform STORED depth;  // of opaque surfaces
#ifdef PEELED
uniform STORED before;  // of the layer before
#endif
out vec4 layer;  // scene-linear, premultiplied; alpha is opacity

void main() {
    Surface s = surface_here(PASS_VIEW);  // first: it takes derivatives, for which neighbours have to be there
    ivec2 texel = ivec2(gl_FragCoord.xy);
    if (nearer(texelFetch(depth, texel, HERE).r, gl_FragCoord.z)) discard;
#ifdef PEELED
    if (!nearer(texelFetch(before, texel, HERE).r, gl_FragCoord.z)) discard;
#endif
    layer = vec4(radiance_of(s, reflected_lights(s), light_around(s)) * s.alpha, s.alpha);
}
