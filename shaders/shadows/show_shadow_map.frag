// A shadow map over the surfaces that it is looked up for. It is looked up as shadows are, by `shadow()`: what that
// blends is here one channel after the other of a colour.
#include <layer_colors.glsl>
#include "range_fraction.glsl"
#include <depth_surface.glsl>

uniform sampler2DArray shadow_map;
uniform float opacity;
uniform int texels;  // along a side of a square
out vec4 color;

#define MAP_HALF_WIDTH 0.0
const int COVERED = 3;
int channel;

vec3 tint(int layer, vec3 place) {
#if SHOWN == SHOWN_DEPTH
    float depth = textureLod(shadow_map, vec3(place.xy, float(layer)), 0.0).r;
    return vec3(is_nothing(depth) ? 1.0 : range_fraction(shadow_map_views[layer], vec3(place.xy, depth)));
#else
    ivec2 square = ivec2(place.xy * vec2(textureSize(shadow_map, 0).xy)) / texels;
    float even = float((square.x + square.y) & 1);
#if SHOWN == SHOWN_TEXELS
    return vec3(even);
#elif SHOWN == SHOWN_LAYERS
    return layer_color(layer);
#else
    return layer_color(layer) * mix(0.45, 1.0, even);
#endif
#endif
}

// One channel, or 0 where a layer is found at all: `shadow()` says 1 where there is none.
float map_visibility(int layer, vec3 place) {
    return channel == COVERED ? 0.0 : tint(layer, place)[channel];
}

#include "map_shadow.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float d;
    vec3 position = position_at(texel, TEXEL_CENTER, d);
    if (is_nothing(d)) discard;
    for (channel = 0; channel < 3; ++channel) color[channel] = shadow(LIGHT, position, vec3(0.0));
    color.a = opacity * (1.0 - shadow(LIGHT, position, vec3(0.0)));
}
