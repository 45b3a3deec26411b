// The first four moments of depth in one layer of a shadow map, averaged along columns, and the share of covered
// texels. Depth is mapped to z from -1 to 1: there the moments are far better conditioned in float32 than from 0 to 1.
#include "range_fraction.glsl"

uniform sampler2D shadow_map;
uniform int first_row;  // of the band that is drawn, in the map
uniform int radius;     // texels
out vec4 filtered;
out float covered;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    vec4 sum = vec4(0.0);
    covered = 0.0;
    View view = shadow_map_views[LAYER];
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, other, 0).r;
        if (is_nothing(depth)) continue;
        float z = 2.0 * range_fraction(view, vec3((vec2(other) + 0.5) * view.viewport.zw, depth)) - 1.0;
        sum += vec4(z, z * z, z * z * z, z * z * z * z);
        covered += 1.0;
    }
    float taps = float(2 * radius + 1);
    filtered = sum / taps;
    covered /= taps;
}
