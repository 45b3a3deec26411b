// Exponential shadow maps (T. Annen, T. Mertens, H.-P. Seidel, E. Flerackers, J. Kautz, "Exponential Shadow Maps",
// 2008).
#include "range_fraction.glsl"

uniform sampler2DArray filtered;  // mean of exp(exponent z) over the filter, 0 where nothing is
uniform sampler2DArray covered;   // share of the filter where something is
uniform float exponent;

#define MAP_HALF_WIDTH 1.0  // the filter's width needs no offset: on a slope the mean is above the receiver's own
#define MAP_VIEWS filtered_views
#define MAP_LIGHTS filtered_lights
#define MAP_LAYERS FILTERED_LAYERS

// What of a receiver at t is lit, where `empty` of the filter holds nothing.
float share_lit(float mean, float empty, float t) {
    return min(mean * exp(-exponent * t) + empty, 1.0);
}

float map_visibility(int layer, vec3 place) {
    vec3 at = vec3(place.xy, float(layer));
    float empty = 1.0 - textureLod(covered, at, 0.0).r;
    return share_lit(textureLod(filtered, at, 0.0).r, empty, range_fraction(MAP_VIEWS[layer], place.z));
}

#include "map_shadow.glsl"
