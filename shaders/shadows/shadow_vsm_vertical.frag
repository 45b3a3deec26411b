// The first two moments of the depth z in one layer of a shadow map, averaged along columns: z and z², and the
// coverage.
#include "range_fraction.glsl"

uniform sampler2D shadow_map;
uniform int first_row;  // of the current band, in the map
uniform int radius;     // texels
out vec2 filtered_map;
out float coverage;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    int last = textureSize(shadow_map, 0).y - 1;
    vec3 sum = vec3(0.0);
    View view = shadow_map_views[LAYER];
    for (int i = -radius; i <= radius; ++i) {
        ivec2 tap = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float depth = texelFetch(shadow_map, tap, 0).r;
        if (is_nothing(depth)) continue;
        float z = range_fraction(view, vec3((vec2(tap) + 0.5) * view.viewport.zw, depth));
        sum += vec3(z, z * z, 1.0);
    }
    sum /= float(2 * radius + 1);
    filtered_map = sum.xy;
    coverage = sum.z;
}
