// Percentage-closer soft shadows (R. Fernando, "Percentage-Closer Soft Shadows", 2005): a search for the mean distance
// of the blockers, then a filter as wide as the penumbra that an area light casts from that distance.
#include "poisson_disc.glsl"
#include <math.glsl>
#include <noise.glsl>

uniform sampler2DArray shadow_map;
uniform float size;        // diameter of point and spot lights, metres
uniform float angle;       // angular diameter of directional lights, radians
uniform float max_radius;  // texels

#define MAP_HALF_WIDTH 1.0
#define MAP_SLOPE
vec2 map_slope;
float map_texel;

// Width in metres of the penumbra on a receiver; the arguments are distances from the light.
float penumbra_width(View view, float blocker, float receiver) {
    float separation = max(receiver - blocker, 0.0);
    return view.eye.w == 0.0 ? 2.0 * tan(0.5 * angle) * separation : size * separation / max(blocker, 1e-6);
}

// Depth of the map (x) and of the receiver's plane (y) at an offset in texels.
vec2 map_and_receiver_depth(int layer, vec3 coords, vec2 offset, vec2 map_size) {
    vec3 tap = vec3(coords.xy + offset / map_size, float(layer));
    return vec2(textureLod(shadow_map, tap, 0.0).r, max(coords.z + dot(offset, map_slope), 0.0));
}

// Bilinearly weighted depth test at an offset in texels.
float bilinear_test(int layer, vec3 coords, vec2 offset, vec2 map_size) {
    vec2 texel_coords = coords.xy * map_size + offset - 0.5;
    vec2 weights = fract(texel_coords);
    vec4 depths = textureGather(shadow_map, vec3((floor(texel_coords) + 1.0) / map_size, float(layer)));
    float receiver = max(coords.z + dot(offset, map_slope), 0.0);  // nothing is behind the far plane
    vec4 tests = vec4(1.0);
    for (int i = 0; i < 4; ++i) tests[i] = nearer(depths[i], receiver) ? 0.0 : 1.0;
    vec2 rows = mix(tests.wx, tests.zy, weights.x);
    return mix(rows.x, rows.y, weights.y);
}

float map_visibility(int layer, vec3 coords) {
    View view = shadow_map_views[layer];
    vec2 map_size = view.viewport.xy;
    float receiver = linear_depth(view, coords.xy, coords.z);
    float rotation_angle = 2.0 * PI * interleaved_gradient_noise(gl_FragCoord.xy);
    mat2 rotation = mat2(cos(rotation_angle), sin(rotation_angle), -sin(rotation_angle), cos(rotation_angle));

    // Blockers may be anywhere between the near plane and the receiver.
    float search_radius = min(0.5 * penumbra_width(view, view.range.x, receiver) / map_texel, max_radius);
    float blockers = 0.0;
    float sum = 0.0;
    for (int i = 0; i < SEARCHES; ++i) {
        vec2 depths = map_and_receiver_depth(layer, coords, rotation * poisson_disc[i] * search_radius, map_size);
        if (!nearer(depths.x, depths.y)) continue;
        blockers += 1.0;
        sum += linear_depth(view, coords.xy, depths.x);
    }
    if (blockers == 0.0) return 1.0;

    float width = penumbra_width(view, sum / blockers, receiver);
    float filter_radius = clamp(0.5 * width / map_texel, 0.5, max_radius);
    float lit = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        lit += bilinear_test(layer, coords, rotation * poisson_disc[i] * filter_radius, map_size);
    }
    return lit / float(SAMPLES);
}

#include "map_shadow.glsl"
