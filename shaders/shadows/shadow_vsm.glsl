// Variance shadow maps (W. Donnelly, A. Lauritzen, "Variance Shadow Maps", 2006).
#include "filtered_map.glsl"
#include "range_fraction.glsl"

uniform sampler2DArray filtered;  // means of z and z² over the filter, 0 where nothing is
uniform float min_variance;
uniform float light_bleeding;

// The most that can lie behind t of something with this mean and mean square, less what counts as bleeding.
float share_behind(vec2 moments, float t) {
    float behind = t - moments.x;
    if (behind <= 0.0) return 1.0;
    float variance = max(moments.y - moments.x * moments.x, min_variance);
    float share = variance / (variance + behind * behind);
    return clamp((share - light_bleeding) / (1.0 - light_bleeding), 0.0, 1.0);
}

float map_visibility(int layer, vec3 place) {
    float t = range_fraction(MAP_VIEWS[layer], place);
    vec3 at = vec3(place.xy, float(layer));
    // Where nothing is drawn lies the receiver itself.
    vec2 empty = (1.0 - textureLod(covered, at, 0.0).r) * vec2(t, t * t);
    return share_behind(textureLod(filtered, at, 0.0).rg + empty, t);
}

#include "map_shadow.glsl"
