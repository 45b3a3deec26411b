// Convolution shadow maps (T. Annen, T. Mertens, P. Bekaert, H.-P. Seidel, J. Kautz, "Convolution Shadow Maps", 2007).
#include "filtered_map.glsl"
#include "range_fraction.glsl"
#include <math.glsl>

uniform sampler2DArray filtered_map;  // two terms per layer: means of sin(c z) and cos(c z), 0 where the map is empty
uniform float offset;

// Term of the Fourier series of the depth test: the sum is 1 for z beyond t, and 1/2 for z = t.
float series_term(vec2 means, float c, float t) {
    return 2.0 / c * (cos(c * t) * means.x - sin(c * t) * means.y);
}

float map_visibility(int layer, vec3 coords) {
    float covered = textureLod(coverage, vec3(coords.xy, float(layer)), 0.0).r;
    // The series rises from 1/2 to 1 within this offset, so that a receiver that is in the map is not half in shadow.
    float t = range_fraction(MAP_VIEWS[layer], coords) - offset * 0.3 / float(TERMS);
    float lit = 0.5 * covered;
    for (int k = 0; k < TERMS; k += 2) {
        vec4 means = textureLod(filtered_map, vec3(coords.xy, float(layer * ((TERMS + 1) / 2) + k / 2)), 0.0);
        float c = PI * float(2 * k + 1);
        lit += series_term(means.xy, c, t);
        if (k + 1 < TERMS) lit += series_term(means.zw, c + 2.0 * PI, t);
    }
    return clamp(lit + 1.0 - covered, 0.0, 1.0);
}

#include "map_shadow.glsl"
