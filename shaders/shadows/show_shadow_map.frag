// Visualises a shadow map on the surfaces that it shadows. It is looked up by `shadow()`, like shadows, so that layers
// blend in the same way. Each lookup returns one colour channel in place of the visibility.
#include <layer_colors.glsl>
#include "range_fraction.glsl"
#include <depth_surface.glsl>

uniform sampler2DArray shadow_map;
uniform float opacity;
uniform int texels;  // along a side of a square
out vec4 color;

#define MAP_HALF_WIDTH 0.0
const int ALPHA_CHANNEL = 3;
int channel;

vec3 map_color(int layer, vec3 coords) {
#if SHOWN == SHOWN_DEPTH
    float depth = textureLod(shadow_map, vec3(coords.xy, float(layer)), 0.0).r;
    return vec3(is_nothing(depth) ? 1.0 : range_fraction(shadow_map_views[layer], vec3(coords.xy, depth)));
#else
    ivec2 square = ivec2(coords.xy * vec2(textureSize(shadow_map, 0).xy)) / texels;
    float parity = float((square.x + square.y) & 1);
#if SHOWN == SHOWN_TEXELS
    return vec3(parity);
#elif SHOWN == SHOWN_LAYERS
    return layer_color(layer);
#else
    return layer_color(layer) * mix(0.45, 1.0, parity);
#endif
#endif
}

// A colour channel, or 0 for the alpha channel: `shadow()` returns 1 where no layer contains the point.
float map_visibility(int layer, vec3 coords) {
    return channel == ALPHA_CHANNEL ? 0.0 : map_color(layer, coords)[channel];
}

#include "map_shadow.glsl"

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float window_depth;
    vec3 position = position_at(texel, TEXEL_CENTER, window_depth);
    if (is_nothing(window_depth)) discard;
    for (channel = 0; channel < 3; ++channel) color[channel] = shadow(LIGHT, position, vec3(0.0));
    color.a = opacity * (1.0 - shadow(LIGHT, position, vec3(0.0)));
}
