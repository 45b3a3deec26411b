// Moment shadow maps (C. Peters, R. Klein, "Moment Shadow Mapping", 2015).
#include "filtered_map.glsl"
#include "range_fraction.glsl"

uniform sampler2DArray filtered_map;  // means of z (-1 to 1) to z⁴ over the filter region, 0 where the map is empty
uniform float moment_bias;
uniform float light_bleeding;

// Lower bound of the fraction of a distribution with moments b that lies before t. Of all distributions with these
// moments, the one with the least mass before t has three points: t and the two roots of an orthogonal polynomial.
float fraction_before(vec4 b, float t) {
    // Move the moments towards those of a uniform distribution, away from invalid ones (Peters and Klein 2015).
    b = mix(b, vec4(0.0, 0.375, 0.0, 0.375), moment_bias);
    // Solve the Hankel matrix (1 b1 b2; b1 b2 b3; b2 b3 b4) for (1, t, t^2) by a Cholesky decomposition.
    float variance = b.y - b.x * b.x;
    float skew = b.z - b.x * b.y;
    float pivot = (b.w - b.y * b.y) * variance - skew * skew;
    vec3 c = vec3(1.0, t - b.x, t * t - b.y);
    c.z = (c.z - skew / variance * c.y) * variance / pivot;
    c.y = (c.y - skew * c.z) / variance;
    c.x -= b.x * c.y + b.y * c.z;
    // Solve the quadratic without cancellation. Where it is nearly linear, one root is clamped to a large distance.
    float discriminant_root = sqrt(max(c.y * c.y - 4.0 * c.x * c.z, 0.0));
    float q = -0.5 * (c.y + (c.y < 0.0 ? -discriminant_root : discriminant_root));
    float first = clamp(q / c.z, -1e4, 1e4);
    float second = c.x / q;
    vec2 roots = vec2(min(first, second), max(first, second));
    if (t <= roots.x) return 0.0;
    if (t <= roots.y) {  // only the first root lies before t
        return (t * roots.y - b.x * (t + roots.y) + b.y) / ((roots.y - roots.x) * (t - roots.x));
    }
    return 1.0 - (roots.x * roots.y - b.x * (roots.x + roots.y) + b.y) / ((t - roots.x) * (t - roots.y));
}

float map_visibility(int layer, vec3 coords) {
    float t = 2.0 * range_fraction(MAP_VIEWS[layer], coords) - 1.0;
    vec3 layer_coords = vec3(coords.xy, float(layer));
    float t2 = t * t, empty = 1.0 - textureLod(coverage, layer_coords, 0.0).r;
    // Texels that the map does not cover count as lying at the receiver.
    vec4 b = textureLod(filtered_map, layer_coords, 0.0) + empty * vec4(t, t2, t2 * t, t2 * t2);
    return clamp(1.0 - fraction_before(b, t) / (1.0 - light_bleeding), 0.0, 1.0);
}

#include "map_shadow.glsl"
