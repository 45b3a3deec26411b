// Whether the samples of a texel may differ in how much of the light reaches them: where that changes between the two
// places in a texel at which it was looked up, and beside that, for neighbours look at other places. Neighbours that
// see several surfaces tell nothing: among three of them a texel is taken for an edge, too.
#include <depth_surface.glsl>

uniform sampler2DMS shadow_difference;  // 1 where samples see different surfaces
uniform float shadow_change;
out float edges;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy), last = textureSize(shadow_difference) - 1;
    float most = texelFetch(shadow_difference, texel, 0).r;
    int silent = 0;
    for (int i = 0; i < 4; ++i) {
        ivec2 beside = texel + ivec2[](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1))[i];
        float difference = texelFetch(shadow_difference, clamp(beside, ivec2(0), last), 0).r;
        if (difference == 1.0) ++silent;
        else most = max(most, difference);
    }
    bool differs = most > shadow_change || silent >= 3;
    edges = differs && !is_nothing(texelFetch(depth, texel, 0).r) ? 1.0 : 0.0;
}
