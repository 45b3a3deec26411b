// Exponentials of the depth z in one layer of a shadow map, averaged along rows, and the share of texels where
// something is.
#include "range_fraction.glsl"

uniform sampler2D shadow_map;
uniform int radius;  // texels
uniform float exponent;
out float filtered;
out float covered;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int last = textureSize(shadow_map, 0).x - 1;
    vec2 sum = vec2(0.0);
    for (int i = -radius; i <= radius; ++i) {
        float depth = texelFetch(shadow_map, ivec2(clamp(texel.x + i, 0, last), texel.y), 0).r;
        if (depth == 1.0) continue;  // nothing is there
        sum += vec2(exp(exponent * range_fraction(shadow_map_views[LAYER], depth)), 1.0);
    }
    sum /= float(2 * radius + 1);
    filtered = sum.x;
    covered = sum.y;
}
