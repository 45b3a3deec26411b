// Nine spherical harmonics of a cube map's radiance (Ramamoorthi and Hanrahan 2001), and the constants of the
// polynomial that gives a diffuse surface's light from them (Sloan 2008). One group: each invocation adds up texels,
// then halves add up in shared memory.
#include <cube.glsl>
#include <math.glsl>
layout(local_size_x = 256) in;

uniform sampler2DArray cells;  // radiance, six faces
uniform int level;
uniform writeonly image2D harmonics;  // 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22 of the radiance; 7 of the polynomial

shared vec3 parts[256];

vec3 added_up(vec3 part) {
    uint own = gl_LocalInvocationIndex;
    barrier();
    parts[own] = part;
    barrier();
    for (uint half_count = 128u; half_count > 0u; half_count >>= 1) {
        if (own < half_count) parts[own] += parts[own + half_count];
        barrier();
    }
    return parts[0];
}

void main() {
    int side = textureSize(cells, level).x;
    vec3 sums[9];
    for (int k = 0; k < 9; ++k) sums[k] = vec3(0.0);
    for (int i = int(gl_LocalInvocationIndex); i < 6 * side * side; i += 256) {
        int face = i / (side * side);
        ivec2 texel = ivec2(i % side, i / side % side);
        vec2 place = cube_texel_center(texel, side);
        vec3 d = cube_direction(face, place);
        vec3 light = texelFetch(cells, ivec3(texel, face), level).rgb * cube_solid_angle(place, side);
        sums[0] += light * 0.282095;
        sums[1] += light * (0.488603 * d.y);
        sums[2] += light * (0.488603 * d.z);
        sums[3] += light * (0.488603 * d.x);
        sums[4] += light * (1.092548 * d.x * d.y);
        sums[5] += light * (1.092548 * d.y * d.z);
        sums[6] += light * (0.315392 * (3.0 * d.z * d.z - 1.0));
        sums[7] += light * (1.092548 * d.x * d.z);
        sums[8] += light * (0.546274 * (d.x * d.x - d.y * d.y));
    }
    for (int k = 0; k < 9; ++k) sums[k] = added_up(sums[k]);

    // Irradiance / pi: the bands of a cosine lobe are pi, 2 pi / 3 and pi / 4.
    float first = 2.0 / 3.0, second = 0.25;
#if WINDOW
    // Nine harmonics of a strong light fall below zero on its far side. The higher bands are damped, by a power of
    // their degree (Sloan 2017), until in none of 256 directions they do.
    float turn = 2.399963 * float(gl_LocalInvocationIndex), z = 1.0 - (float(gl_LocalInvocationIndex) + 0.5) / 128.0;
    vec3 d = vec3(sqrt(1.0 - z * z) * vec2(cos(turn), sin(turn)), z);
    vec3 constant_part = 0.282095 * sums[0];
    vec3 first_part = 0.488603 * (d.y * sums[1] + d.z * sums[2] + d.x * sums[3]);
    vec3 second_part = 1.092548 * (d.x * d.y * sums[4] + d.y * d.z * sums[5] + d.x * d.z * sums[7])
        + 0.315392 * (3.0 * d.z * d.z - 1.0) * sums[6] + 0.546274 * (d.x * d.x - d.y * d.y) * sums[8];
    for (int i = 0; i < 10; ++i) {
        vec3 light = constant_part + first * first_part + second * second_part;
        float below = min(min(light.r, light.g), light.b) < 0.0 ? 1.0 : 0.0;
        if (added_up(vec3(below)).x == 0.0) break;
        first *= 0.94;
        second *= 0.94 * 0.94 * 0.94 * 0.94;
    }
#endif
    if (gl_LocalInvocationIndex > 0u) return;

    for (int k = 0; k < 9; ++k) imageStore(harmonics, ivec2(k, 0), vec4(sums[k], 0.0));
    vec3 constant = 0.282095 * sums[0] - second * 0.315392 * sums[6];
    for (int c = 0; c < 3; ++c) {
        vec4 linear = vec4(first * 0.488603 * vec3(sums[3][c], sums[1][c], sums[2][c]), constant[c]);
        vec4 products = second * vec4(
            1.092548 * sums[4][c], 1.092548 * sums[5][c], 3.0 * 0.315392 * sums[6][c], 1.092548 * sums[7][c]);
        imageStore(harmonics, ivec2(9 + c, 0), linear);
        imageStore(harmonics, ivec2(12 + c, 0), products);
    }
    imageStore(harmonics, ivec2(15, 0), vec4(second * 0.546274 * sums[8], 0.0));
}
