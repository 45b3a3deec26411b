// Exponential shadow maps (T. Annen, T. Mertens, H.-P. Seidel, E. Flerackers, J. Kautz, "Exponential Shadow Maps",
// 2008), filtered as logarithms (M. Salvi, "Rendering Filtered Shadows with Exponential Shadow Maps", ShaderX 6, 2008).
#include "filtered_map.glsl"
#include "view_depth.glsl"

uniform sampler2DArray filtered;  // logarithm of the mean of exp(exponent z) over the filter; empty texels count as 0
uniform float exponent;           // 1/m

// What of a receiver at t is lit, where `empty` of the filter holds nothing.
float share_lit(float log_mean, float empty, float t) {
    return min(exp(min(log_mean - exponent * t, 0.0)) + empty, 1.0);
}

// A texel's mean is limited before texels are weighted bilinearly: a mean of logarithms would be another's.
float map_visibility(int layer, vec3 place) {
    vec2 size = vec2(textureSize(filtered, 0).xy);
    vec2 corner = place.xy * size - 0.5;
    vec2 start = fract(corner);
    vec3 middle = vec3((floor(corner) + 1.0) / size, float(layer));
    vec4 logs = textureGather(filtered, middle);
    vec4 filled = textureGather(covered, middle);
    float t = view_depth(MAP_VIEWS[layer], place);
    vec4 lit;
    for (int i = 0; i < 4; ++i) lit[i] = share_lit(logs[i], 1.0 - filled[i], t);
    vec2 row = mix(lit.wx, lit.zy, start.x);
    return mix(row.x, row.y, start.y);
}

#include "map_shadow.glsl"
