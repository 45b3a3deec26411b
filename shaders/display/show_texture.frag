// Draws a texture, or all of its layers, into a corner of a picture, with a border.
#include <srgb.glsl>

uniform ivec2 origin;     // lower left corner, in texels of the picture
uniform ivec2 tile_size;  // of a layer
uniform float low;
uniform float high;
out vec4 color;

#ifdef HAS_LAYERS
uniform SAMPLER layers;
#define FETCH(texel, layer) texelFetch(layers, ivec3(texel, layer), 0)
#define SIZE textureSize(layers, 0).xy
#define VIEW(layer) layers_views[layer]
#else
uniform SAMPLER source;
#define FETCH(texel, layer) texelFetch(source, texel, 0)
#define SIZE textureSize(source, 0)
#define VIEW(layer) source_views[0]
#endif

// Maps a value to 0 to 1 by its meaning.
vec4 displayed_value(vec4 value, int layer, vec2 uv) {
#ifdef MEANS_DEPTH
    View view = VIEW(layer);
    float distance = linear_depth(view, uv, value.r);
    bool has_infinite_far = isinf(view.range.y);
    float fraction = has_infinite_far ? 1.0 - view.range.x / distance
                                      : (distance - view.range.x) / (view.range.y - view.range.x);
    return vec4(is_nothing(value.r) ? 1.0 : fraction);
#elif defined(MEANS_NORMAL)
    return value * 0.5 + 0.5;
#else
    return value;
#endif
}

void main() {
    const int rows = (LAYERS + COLUMNS - 1) / COLUMNS;
    ivec2 texel = ivec2(gl_FragCoord.xy) - origin;
    ivec2 grid_size = tile_size * ivec2(COLUMNS, rows);
    if (any(lessThan(texel, ivec2(-1))) || any(greaterThan(texel, grid_size))) discard;
    color = vec4(1.0);
    if (any(lessThan(texel, ivec2(0))) || any(equal(texel, grid_size))) return;  // the border

    ivec2 cell = texel / tile_size;
    int layer = (rows - 1 - cell.y) * COLUMNS + cell.x;
    if (layer >= LAYERS) discard;
    vec2 uv = (vec2(texel - cell * tile_size) + 0.5) / vec2(tile_size);
    vec4 value = displayed_value(vec4(FETCH(ivec2(uv * vec2(SIZE)), layer)), layer, uv);
    value = clamp((value - low) / (high - low), 0.0, 1.0);
#if CHANNELS == 1
    color.rgb = value.rrr;
#elif CHANNELS == 2
    color.rgb = vec3(value.rg, 0.0);
#else
    color.rgb = value.rgb;
#endif
#ifdef MEANS_LIGHT
    color.rgb = linear_to_srgb(color.rgb);
#endif
}
