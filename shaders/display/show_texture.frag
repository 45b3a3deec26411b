// A texture, or all layers of one, in a corner of a picture, with a line around it.
#include <srgb.glsl>

uniform ivec2 place;  // of the lower left corner, in texels of the picture
uniform ivec2 tile;   // width and height of a layer there
uniform float low;
uniform float high;
out vec4 color;

#ifdef HAS_LAYERS
uniform SAMPLER layers;
#define TEXEL(at, layer) texelFetch(layers, ivec3(at, layer), 0)
#define SIZE textureSize(layers, 0).xy
#define VIEW(layer) layers_views[layer]
#else
uniform SAMPLER source;
#define TEXEL(at, layer) texelFetch(source, at, 0)
#define SIZE textureSize(source, 0)
#define VIEW(layer) source_views[0]
#endif

// A texel's values as an eye can read them, the channels it lacks apart.
vec4 readable(vec4 value, int layer, vec2 uv) {
#ifdef MEANS_DEPTH
    View view = VIEW(layer);
    float distance = linear_depth(view, uv, value.r);
    bool without_end = isinf(view.range.y);
    float share = without_end ? 1.0 - view.range.x / distance
                              : (distance - view.range.x) / (view.range.y - view.range.x);
    return vec4(is_nothing(value.r) ? 1.0 : share);
#elif defined(MEANS_NORMAL)
    return value * 0.5 + 0.5;
#else
    return value;
#endif
}

void main() {
    const int rows = (LAYERS + COLUMNS - 1) / COLUMNS;
    ivec2 at = ivec2(gl_FragCoord.xy) - place;
    ivec2 whole = tile * ivec2(COLUMNS, rows);
    if (any(lessThan(at, ivec2(-1))) || any(greaterThan(at, whole))) discard;
    color = vec4(1.0);
    if (any(lessThan(at, ivec2(0))) || any(equal(at, whole))) return;

    ivec2 cell = at / tile;
    int layer = (rows - 1 - cell.y) * COLUMNS + cell.x;
    if (layer >= LAYERS) discard;
    vec2 uv = (vec2(at - cell * tile) + 0.5) / vec2(tile);
    vec4 value = readable(vec4(TEXEL(ivec2(uv * vec2(SIZE)), layer)), layer, uv);
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
