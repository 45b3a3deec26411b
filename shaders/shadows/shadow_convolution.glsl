// Convolution shadow maps (T. Annen, T. Mertens, P. Bekaert, H.-P. Seidel, J. Kautz, "Convolution Shadow Maps", 2007).
#include "filtered_map.glsl"
#include "range_fraction.glsl"
#include <math.glsl>

uniform sampler2DArray filtered;  // two terms a layer: means of sin and cos of c z over the filter, 0 where nothing is
uniform float offset;

// The step of the depth test as a Fourier series: 1 where z is beyond t, 1/2 where they are equal.
float step_series(vec2 means, float c, float t) {
    return 2.0 / c * (cos(c * t) * means.x - sin(c * t) * means.y);
}

float map_visibility(int layer, vec3 place) {
    float full = textureLod(covered, vec3(place.xy, float(layer)), 0.0).r;
    // The series climbs from 1/2 to 1 within this much; a receiver that the map holds must not be its own caster.
    float t = range_fraction(MAP_VIEWS[layer], place) - offset * 0.3 / float(TERMS);
    float lit = 0.5 * full;
    for (int k = 0; k < TERMS; k += 2) {
        vec4 means = textureLod(filtered, vec3(place.xy, float(layer * ((TERMS + 1) / 2) + k / 2)), 0.0);
        float c = PI * float(2 * k + 1);
        lit += step_series(means.xy, c, t);
        if (k + 1 < TERMS) lit += step_series(means.zw, c + 2.0 * PI, t);
    }
    return clamp(lit + 1.0 - full, 0.0, 1.0);
}

#include "map_shadow.glsl"
