// Percentage-closer filtering (Reeves, Salesin and Cook 1987): the mean of bilinearly weighted depth tests in a kernel
// around the receiver. One gather returns four tests. With one tap it is a single depth test.
uniform sampler2DArrayShadow shadow_map;

#if TAPS == 1
#define MAP_HALF_WIDTH 0.5
#else
#define MAP_HALF_WIDTH (0.5 * float(TAPS + 1))
#endif

#if TAPS == 1
float filtered_visibility(int layer, vec3 coords) {
    return texture(shadow_map, vec4(coords.xy, float(layer), coords.z));
}

#elif KERNEL == KERNEL_BOX || KERNEL == KERNEL_TENT
// TAPS × TAPS bilinear tests, one texel apart, read (TAPS + 1) × (TAPS + 1) texels, the outer ones with a partial
// weight.
float tap_weight(int tap) {
#if KERNEL == KERNEL_TENT
    return float(max(min(tap + 1, TAPS - tap), 0));
#else
    return tap >= 0 && tap < TAPS ? 1.0 : 0.0;
#endif
}

// Weight of texel `index` along one axis; `fraction` is the kernel's start within the first texel.
float texel_weight(int index, float fraction) {
    return mix(tap_weight(index), tap_weight(index - 1), fraction);
}

float filtered_visibility(int layer, vec3 coords) {
    vec2 size = vec2(textureSize(shadow_map, 0).xy);
    vec2 texel_size = 1.0 / size;
    vec2 start = coords.xy * size - 0.5 * float(TAPS);
    vec2 first = floor(start);
    vec2 fraction = start - first;
    float sum = 0.0;
    for (int y = 0; y <= TAPS; y += 2) {
        for (int x = 0; x <= TAPS; x += 2) {
            vec2 gather_coords = (first + vec2(x + 1, y + 1)) * texel_size;
            // Order of the tests: upper left, upper right, lower right, lower left.
            vec4 tests = textureGather(shadow_map, vec3(gather_coords, float(layer)), coords.z);
            vec2 weights_x = vec2(texel_weight(x, fraction.x), texel_weight(x + 1, fraction.x));
            vec2 weights_y = vec2(texel_weight(y, fraction.y), texel_weight(y + 1, fraction.y));
            sum += dot(tests, weights_x.xyyx * weights_y.yyxx);
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

float filtered_visibility(int layer, vec3 coords) {
    vec2 size = vec2(textureSize(shadow_map, 0).xy);
    mat2 disc_to_texels = mat2(0.5 * float(TAPS));
#if KERNEL == KERNEL_ROTATED
    float angle = 2.0 * PI * interleaved_gradient_noise(gl_FragCoord.xy);
    disc_to_texels *= mat2(cos(angle), sin(angle), -sin(angle), cos(angle));
#endif
    float sum = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        vec2 texel_coords = coords.xy * size + disc_to_texels * poisson_disc[i] - 0.5;
        vec2 first = floor(texel_coords);
        vec2 weights = texel_coords - first;
        vec4 tests = textureGather(shadow_map, vec3((first + 1.0) / size, float(layer)), coords.z);
        vec2 rows = mix(tests.wx, tests.zy, weights.x);
        sum += mix(rows.x, rows.y, weights.y);
    }
    return sum / float(SAMPLES);
}
#endif

#ifdef HAS_DEPTH_RANGES
uniform sampler2DArray depth_ranges;  // nearest and farthest depth that a kernel centred in a tile may read

float map_visibility(int layer, vec3 coords) {
    vec2 tiles = vec2(textureSize(depth_ranges, 0).xy);
    ivec2 tile = ivec2(min(coords.xy * tiles, tiles - 1.0));
    vec2 range = texelFetch(depth_ranges, ivec3(tile, layer), 0).rg;
    if (!nearer(range.x, coords.z)) return 1.0;
    if (nearer(range.y, coords.z)) return 0.0;
    return filtered_visibility(layer, coords);
}
#else
float map_visibility(int layer, vec3 coords) {
    return filtered_visibility(layer, coords);
}
#endif

#include "map_shadow.glsl"
