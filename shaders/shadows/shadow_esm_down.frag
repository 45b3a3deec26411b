// The logarithm of the mean of exponentials of depth along columns of one layer of a shadow map, and the share of
// texels where something is. Sums of exponentials overflow; their logarithms, taken from the largest on, do not.
#include "view_depth.glsl"

uniform sampler2D shadow_map;
uniform int first_row;   // of the band that is drawn, in the map
uniform int radius;      // texels
uniform float exponent;  // 1/m
out float filtered;
out float covered;

const float NOTHING = -1e30;  // the logarithm of no light

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    View view = shadow_map_views[LAYER];
    float most = NOTHING;
    float sum = 0.0;  // of exponentials, over exp(most)
    covered = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, other, 0).r;
        if (is_nothing(depth)) continue;
        float here = exponent * view_depth(view, vec3((vec2(other) + 0.5) * view.viewport.zw, depth));
        sum = here > most ? sum * exp(most - here) + 1.0 : sum + exp(here - most);
        most = max(most, here);
        covered += 1.0;
    }
    float taps = float(2 * radius + 1);
    filtered = sum > 0.0 ? most + log(sum / taps) : NOTHING;
    covered /= taps;
}
