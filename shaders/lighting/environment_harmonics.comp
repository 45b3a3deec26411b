// Projects the radiance of a cube map to nine spherical harmonics (Ramamoorthi and Hanrahan 2001), and computes the
// coefficients of the polynomial that evaluates irradiance / π (Sloan 2008). A single work group: each invocation sums
// texels, then a parallel reduction sums in shared memory.
#include <cube.glsl>
#include <math.glsl>
layout(local_size_x = 256) in;

uniform sampler2DArray cells;  // radiance, six faces
uniform int level;
// L00, L1-1, L10, L11, L2-2, L2-1, L20, L21, L22 of the radiance; 7 of the polynomial.
uniform writeonly image2D harmonics;

shared vec3 partial_sums[256];

// Sum of a value over all invocations of the group.
vec3 group_sum(vec3 value) {
    uint index = gl_LocalInvocationIndex;
    barrier();
    partial_sums[index] = value;
    barrier();
    for (uint stride = 128u; stride > 0u; stride >>= 1) {
        if (index < stride) partial_sums[index] += partial_sums[index + stride];
        barrier();
    }
    return partial_sums[0];
}

void main() {
    int size = textureSize(cells, level).x;
    vec3 sums[9];
    for (int k = 0; k < 9; ++k) sums[k] = vec3(0.0);
    for (int i = int(gl_LocalInvocationIndex); i < 6 * size * size; i += 256) {
        int face = i / (size * size);
        ivec2 texel = ivec2(i % size, i / size % size);
        vec2 position = cube_texel_center(texel, size);
        vec3 d = cube_direction(face, position);
        vec3 light = texelFetch(cells, ivec3(texel, face), level).rgb * cube_solid_angle(position, size);
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
    for (int k = 0; k < 9; ++k) sums[k] = group_sum(sums[k]);

    // Band factors of irradiance / π: a cosine lobe has π, 2π / 3 and π / 4.
    float band1 = 2.0 / 3.0, band2 = 0.25;
#if WINDOW
    // Opposite a strong light, nine harmonics become negative. The higher bands are damped by a power of their degree
    // (Sloan 2017) until the irradiance is positive in all of 256 directions.
    float phi = 2.399963 * float(gl_LocalInvocationIndex), z = 1.0 - (float(gl_LocalInvocationIndex) + 0.5) / 128.0;
    vec3 d = vec3(sqrt(1.0 - z * z) * vec2(cos(phi), sin(phi)), z);
    vec3 irradiance0 = 0.282095 * sums[0];
    vec3 irradiance1 = 0.488603 * (d.y * sums[1] + d.z * sums[2] + d.x * sums[3]);
    vec3 irradiance2 = 1.092548 * (d.x * d.y * sums[4] + d.y * d.z * sums[5] + d.x * d.z * sums[7])
        + 0.315392 * (3.0 * d.z * d.z - 1.0) * sums[6] + 0.546274 * (d.x * d.x - d.y * d.y) * sums[8];
    for (int i = 0; i < 10; ++i) {
        vec3 light = irradiance0 + band1 * irradiance1 + band2 * irradiance2;
        float is_negative = min(min(light.r, light.g), light.b) < 0.0 ? 1.0 : 0.0;
        if (group_sum(vec3(is_negative)).x == 0.0) break;
        band1 *= 0.94;
        band2 *= 0.94 * 0.94 * 0.94 * 0.94;
    }
#endif
    if (gl_LocalInvocationIndex > 0u) return;

    for (int k = 0; k < 9; ++k) imageStore(harmonics, ivec2(k, 0), vec4(sums[k], 0.0));
    vec3 constant = 0.282095 * sums[0] - band2 * 0.315392 * sums[6];
    for (int c = 0; c < 3; ++c) {
        vec4 linear = vec4(band1 * 0.488603 * vec3(sums[3][c], sums[1][c], sums[2][c]), constant[c]);
        vec4 quadratic = band2 * vec4(
            1.092548 * sums[4][c], 1.092548 * sums[5][c], 3.0 * 0.315392 * sums[6][c], 1.092548 * sums[7][c]);
        imageStore(harmonics, ivec2(9 + c, 0), linear);
        imageStore(harmonics, ivec2(12 + c, 0), quadratic);
    }
    imageStore(harmonics, ivec2(15, 0), vec4(band2 * 0.546274 * sums[8], 0.0));
}
