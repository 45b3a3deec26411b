// Exponential shadow maps (T. Annen, T. Mertens, H.-P. Seidel, E. Flerackers, J. Kautz, "Exponential Shadow Maps",
// 2008), filtered as logarithms (M. Salvi, "Rendering Filtered Shadows with Exponential Shadow Maps", ShaderX 6, 2008).
#include "filtered_map.glsl"
#include "view_depth.glsl"

uniform sampler2DArray filtered_map;  // logarithm of the mean of exp(exponent z); empty texels contribute 0 to the mean
uniform float exponent;               // 1/m

// Visibility of a receiver at t, where a fraction `empty` of the filter region is not covered by the map.
float exponential_visibility(float log_mean, float empty, float t) {
    return min(exp(min(log_mean - exponent * t, 0.0)) + empty, 1.0);
}

// Visibility is computed per texel and then interpolated bilinearly: interpolated logarithms would not be the logarithm
// of the interpolated mean.
float map_visibility(int layer, vec3 coords) {
    vec2 size = vec2(textureSize(filtered_map, 0).xy);
    vec2 texel_coords = coords.xy * size - 0.5;
    vec2 weights = fract(texel_coords);
    vec3 gather_coords = vec3((floor(texel_coords) + 1.0) / size, float(layer));
    vec4 log_means = textureGather(filtered_map, gather_coords);
    vec4 covered = textureGather(coverage, gather_coords);
    float t = view_depth(MAP_VIEWS[layer], coords);
    vec4 lit;
    for (int i = 0; i < 4; ++i) lit[i] = exponential_visibility(log_means[i], 1.0 - covered[i], t);
    vec2 rows = mix(lit.wx, lit.zy, weights.x);
    return mix(rows.x, rows.y, weights.y);
}

#include "map_shadow.glsl"
