// Whether the samples of a texel may differ in how much of the light reaches them: where the lit share, which is known
// in the middle of texels, does not run on straight from one neighbour to the other. Where it does, the mean of the
// samples is the light of the middle. Where depth is bent a neighbour is on another surface, and a large difference
// counts.
#include <depth_surface.glsl>

uniform sampler2DMS lit_share;
uniform float shadow_change;
out float edges;

bool bends(ivec2 texel, ivec2 axis, float d) {
    ivec2 last = textureSize(lit_share) - 1;
    ivec2 before = max(texel - axis, ivec2(0)), after = min(texel + axis, last);
    float down = d - texelFetch(depth, before, 0).r, up = texelFetch(depth, after, 0).r - d;
    float low = texelFetch(lit_share, before, 0).r, high = texelFetch(lit_share, after, 0).r;
    float here = texelFetch(lit_share, texel, 0).r;
    if (abs(up - down) > 0.2 * max(abs(up), abs(down)) + 1e-6 * d) return max(abs(low - here), abs(high - here)) > 0.1;
    return abs(low + high - 2.0 * here) > shadow_change;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float d = texelFetch(depth, texel, 0).r;
    edges = 0.0;
    if (is_nothing(d)) return;
    if (bends(texel, ivec2(1, 0), d) || bends(texel, ivec2(0, 1), d) || bends(texel, ivec2(1, 1), d) ||
        bends(texel, ivec2(1, -1), d)) edges = 1.0;
}
