// Variance shadow maps (W. Donnelly, A. Lauritzen, "Variance Shadow Maps", 2006).
#include "filtered_map.glsl"
#include "range_fraction.glsl"

uniform sampler2DArray filtered_map;  // means of z and z² over the filter region, 0 where the map is empty
uniform float min_variance;
uniform float light_bleeding;

// Chebyshev's upper bound of the fraction of a distribution that lies behind t, reduced against light bleeding.
float chebyshev_bound(vec2 moments, float t) {
    float difference = t - moments.x;
    if (difference <= 0.0) return 1.0;
    float variance = max(moments.y - moments.x * moments.x, min_variance);
    float bound = variance / (variance + difference * difference);
    return clamp((bound - light_bleeding) / (1.0 - light_bleeding), 0.0, 1.0);
}

float map_visibility(int layer, vec3 coords) {
    float t = range_fraction(MAP_VIEWS[layer], coords);
    vec3 layer_coords = vec3(coords.xy, float(layer));
    // Texels that the map does not cover count as lying at the receiver.
    vec2 empty = (1.0 - textureLod(coverage, layer_coords, 0.0).r) * vec2(t, t * t);
    return chebyshev_bound(textureLod(filtered_map, layer_coords, 0.0).rg + empty, t);
}

#include "map_shadow.glsl"
