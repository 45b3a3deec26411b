// Moment shadow maps (C. Peters, R. Klein, "Moment Shadow Mapping", 2015).
#include "filtered_map.glsl"
#include "range_fraction.glsl"

uniform sampler2DArray filtered;  // moments of z (-1 to 1) to z^4 over the filter, 0 where the map is empty
uniform float moment_bias;
uniform float light_bleeding;

// Lower bound of the fraction of a distribution with moments b that lies before t. Of all distributions with these
// moments, the one with the least mass before t has three points: t and the two roots of an orthogonal polynomial.
float share_before(vec4 b, float t) {
    // Towards the moments of a spread-out distribution, away from the limits of the possible (Peters and Klein 2015).
    b = mix(b, vec4(0.0, 0.375, 0.0, 0.375), moment_bias);
    // Solve the Hankel matrix (1 b1 b2; b1 b2 b3; b2 b3 b4) for (1, t, t^2) by a Cholesky decomposition.
    float variance = b.y - b.x * b.x;
    float skew = b.z - b.x * b.y;
    float rest = (b.w - b.y * b.y) * variance - skew * skew;
    vec3 c = vec3(1.0, t - b.x, t * t - b.y);
    c.z = (c.z - skew / variance * c.y) * variance / rest;
    c.y = (c.y - skew * c.z) / variance;
    c.x -= b.x * c.y + b.y * c.z;
    // Without cancellation, and with the second root at a large distance where the polynomial is nearly linear.
    float root = sqrt(max(c.y * c.y - 4.0 * c.x * c.z, 0.0));
    float q = -0.5 * (c.y + (c.y < 0.0 ? -root : root));
    float first = clamp(q / c.z, -1e4, 1e4);
    float second = c.x / q;
    vec2 zeros = vec2(min(first, second), max(first, second));
    if (t <= zeros.x) return 0.0;
    if (t <= zeros.y) {  // only the first lies before t: its share
        return (t * zeros.y - b.x * (t + zeros.y) + b.y) / ((zeros.y - zeros.x) * (t - zeros.x));
    }
    return 1.0 - (zeros.x * zeros.y - b.x * (zeros.x + zeros.y) + b.y) / ((t - zeros.x) * (t - zeros.y));
}

float map_visibility(int layer, vec3 place) {
    float t = 2.0 * range_fraction(MAP_VIEWS[layer], place) - 1.0;
    vec3 at = vec3(place.xy, float(layer));
    float t2 = t * t;
    // An uncovered texel counts as lying at the receiver.
    vec4 b = textureLod(filtered, at, 0.0) + (1.0 - textureLod(covered, at, 0.0).r) * vec4(t, t2, t2 * t, t2 * t2);
    return clamp(1.0 - share_before(b, t) / (1.0 - light_bleeding), 0.0, 1.0);
}

#include "map_shadow.glsl"
