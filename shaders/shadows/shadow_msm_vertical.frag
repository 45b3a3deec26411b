// The first four moments of depth in one layer of a shadow map, averaged along columns, and the coverage. Depth is
// mapped to z from -1 to 1, where moments are much better conditioned in float32 than from 0 to 1.
#include "range_fraction.glsl"

uniform sampler2D shadow_map;
uniform int first_row;  // of the current band, in the map
uniform int radius;     // texels
out vec4 filtered_map;
out float coverage;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    vec4 sum = vec4(0.0);
    coverage = 0.0;
    View view = shadow_map_views[LAYER];
    for (int i = -radius; i <= radius; ++i) {
        ivec2 tap = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, tap, 0).r;
        if (is_nothing(depth)) continue;
        float z = 2.0 * range_fraction(view, vec3((vec2(tap) + 0.5) * view.viewport.zw, depth)) - 1.0;
        sum += vec4(z, z * z, z * z * z, z * z * z * z);
        coverage += 1.0;
    }
    float taps = float(2 * radius + 1);
    filtered_map = sum / taps;
    coverage /= taps;
}
