// Percentage-closer filtering (Reeves, Salesin and Cook 1987): the mean of depth tests around a place in the map, each
// weighted bilinearly. Four tests come with one gather. One tap is the plain test of one texel.
uniform sampler2DArrayShadow shadow_map;

#if TAPS == 1
#define MAP_HALF_WIDTH 0.5
#else
#define MAP_HALF_WIDTH (0.5 * float(TAPS + 1))
#endif

#if TAPS == 1
float filtered_tests(int layer, vec3 place) {
    return texture(shadow_map, vec4(place.xy, float(layer), place.z));
}

#elif KERNEL == KERNEL_BOX || KERNEL == KERNEL_TENT
// TAPS x TAPS tests one texel apart are (TAPS + 1) x (TAPS + 1) texels, the outer ones counted in part.
float weight(int tap) {
#if KERNEL == KERNEL_TENT
    return float(max(min(tap + 1, TAPS - tap), 0));
#else
    return tap >= 0 && tap < TAPS ? 1.0 : 0.0;
#endif
}

// How much texel `index` counts where the kernel begins at the fraction `start` of the first.
float share(int index, float start) {
    return mix(weight(index), weight(index - 1), start);
}

float filtered_tests(int layer, vec3 place) {
    vec2 size = vec2(textureSize(shadow_map, 0).xy);
    vec2 texel = 1.0 / size;
    vec2 corner = place.xy * size - 0.5 * float(TAPS);
    vec2 first = floor(corner);
    vec2 start = corner - first;
    float sum = 0.0;
    for (int y = 0; y <= TAPS; y += 2) {
        for (int x = 0; x <= TAPS; x += 2) {
            vec2 middle = (first + vec2(x + 1, y + 1)) * texel;
            // Upper left, upper right, lower right, lower left.
            vec4 lit = textureGather(shadow_map, vec3(middle, float(layer)), place.z);
            vec2 columns = vec2(share(x, start.x), share(x + 1, start.x));
            vec2 rows = vec2(share(y, start.y), share(y + 1, start.y));
            sum += dot(lit, columns.xyyx * rows.yyxx);
        }
    }
#if KERNEL == KERNEL_TENT
    const int total = ((TAPS + 1) / 2) * ((TAPS + 2) / 2);
#else
    const int total = TAPS;
#endif
    return sum / float(total * total);
}

#else
#include "poisson_disc.glsl"
#include <math.glsl>
#include <noise.glsl>

float filtered_tests(int layer, vec3 place) {
    vec2 size = vec2(textureSize(shadow_map, 0).xy);
    mat2 turn = mat2(0.5 * float(TAPS));
#if KERNEL == KERNEL_ROTATED
    float angle = 2.0 * PI * interleaved_gradient_noise(gl_FragCoord.xy);
    turn *= mat2(cos(angle), sin(angle), -sin(angle), cos(angle));
#endif
    float sum = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        vec2 corner = place.xy * size + turn * poisson_disc[i] - 0.5;
        vec2 first = floor(corner);
        vec2 start = corner - first;
        vec4 lit = textureGather(shadow_map, vec3((first + 1.0) / size, float(layer)), place.z);
        vec2 row = mix(lit.wx, lit.zy, start.x);
        sum += mix(row.x, row.y, start.y);
    }
    return sum / float(SAMPLES);
}
#endif

#ifdef HAS_EDGES
uniform sampler2DArray edges;  // the nearest and the farthest depth a kernel may meet that is centred in a tile

float map_visibility(int layer, vec3 place) {
    vec2 tiles = vec2(textureSize(edges, 0).xy);
    ivec2 tile = ivec2(min(place.xy * tiles, tiles - 1.0));
    vec2 range = texelFetch(edges, ivec3(tile, layer), 0).rg;
    if (!nearer(range.x, place.z)) return 1.0;
    if (nearer(range.y, place.z)) return 0.0;
    return filtered_tests(layer, place);
}
#else
float map_visibility(int layer, vec3 place) {
    return filtered_tests(layer, place);
}
#endif

#include "map_shadow.glsl"
