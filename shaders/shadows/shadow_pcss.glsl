// Percentage-closer soft shadows (R. Fernando, "Percentage-Closer Soft Shadows", 2005): first the mean distance of what
// is in the way, then a filter as wide as the penumbra that a light of some size has behind it.
#include "poisson_disc.glsl"
#include <math.glsl>
#include <noise.glsl>

uniform sampler2DArray shadow_map;
uniform float size;        // metres across, of point and spot lights
uniform float angle;       // radians across, of directional ones
uniform float max_radius;  // texels

#define MAP_HALF_WIDTH 1.0
#define MAP_SLOPE
vec2 map_slope;
float map_texel;

// How wide the penumbra is, in metres, of something at the distance `blocker` before a receiver at `receiver`.
float penumbra(View view, float blocker, float receiver) {
    float apart = max(receiver - blocker, 0.0);
    return view.eye.w == 0.0 ? 2.0 * tan(0.5 * angle) * apart : size * apart / max(blocker, 1e-6);
}

// Depth of the map at a point of the disc, and of the receiver's plane there.
vec2 depths_at(int layer, vec3 place, vec2 apart, vec2 texels) {
    vec3 at = vec3(place.xy + apart / texels, float(layer));
    return vec2(textureLod(shadow_map, at, 0.0).r, place.z + dot(apart, map_slope));
}

// The test at a point of the disc, weighted bilinearly over four texels.
float bilinear_test(int layer, vec3 place, vec2 apart, vec2 texels) {
    vec2 corner = place.xy * texels + apart - 0.5;
    vec2 start = fract(corner);
    vec4 depths = textureGather(shadow_map, vec3((floor(corner) + 1.0) / texels, float(layer)));
    float receiver = place.z + dot(apart, map_slope);
    vec4 lit = vec4(1.0);
    for (int i = 0; i < 4; ++i) lit[i] = nearer(depths[i], receiver) ? 0.0 : 1.0;
    vec2 row = mix(lit.wx, lit.zy, start.x);
    return mix(row.x, row.y, start.y);
}

float map_visibility(int layer, vec3 place) {
    View view = shadow_map_views[layer];
    vec2 texels = view.viewport.xy;
    float receiver = linear_depth(view, place.xy, place.z);
    float turned = 2.0 * PI * interleaved_gradient_noise(gl_FragCoord.xy);
    mat2 turn = mat2(cos(turned), sin(turned), -sin(turned), cos(turned));

    // Anything from the near plane on may be in the way.
    float search = min(0.5 * penumbra(view, view.range.x, receiver) / map_texel, max_radius);
    float blockers = 0.0;
    float sum = 0.0;
    for (int i = 0; i < SEARCHES; ++i) {
        vec2 there = depths_at(layer, place, turn * poisson_disc[i] * search, texels);
        if (!nearer(there.x, there.y)) continue;
        blockers += 1.0;
        sum += linear_depth(view, place.xy, there.x);
    }
    if (blockers == 0.0) return 1.0;

    float radius = clamp(0.5 * penumbra(view, sum / blockers, receiver) / map_texel, 0.5, max_radius);
    float lit = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        lit += bilinear_test(layer, place, turn * poisson_disc[i] * radius, texels);
    }
    return lit / float(SAMPLES);
}

#include "map_shadow.glsl"
