// Detects texels whose samples may differ in visibility: where it differs between the two positions of the texel at
// which it was looked up, or in a neighbouring texel, which was looked up at other positions. Neighbours whose samples
// see different surfaces have no such difference; a texel with three or more of them counts as an edge.
#include <depth_surface.glsl>

uniform sampler2DMS shadow_difference;  // 1 where samples see different surfaces
uniform float shadow_change;
out float edges;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy), last = textureSize(shadow_difference) - 1;
    float max_difference = texelFetch(shadow_difference, texel, 0).r;
    int unknown = 0;
    for (int i = 0; i < 4; ++i) {
        ivec2 neighbour = texel + ivec2[](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1))[i];
        float difference = texelFetch(shadow_difference, clamp(neighbour, ivec2(0), last), 0).r;
        if (difference == 1.0) ++unknown;
        else max_difference = max(max_difference, difference);
    }
    bool is_edge = max_difference > shadow_change || unknown >= 3;
    edges = is_edge && !is_nothing(texelFetch(depth, texel, 0).r) ? 1.0 : 0.0;
}
