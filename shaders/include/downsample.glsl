// One level of a mip chain from the level above, at any size. A level has half the size of the one above, rounded down;
// along an odd side of 2m + 1 texels each of the m new texels covers 2 + 1/m old ones, so three are weighted by their
// overlap (S. Guthe and P. Heckbert, "Non-Power-of-Two Mipmap Creation", 2005). Every level keeps the mean of the level
// above.

// Weights of the up to three texels from 2 * index on, along a side of `size` texels.
vec3 downsample_weights(int index, int size) {
    if (size == 1) return vec3(1.0, 0.0, 0.0);
    if (size % 2 == 0) return vec3(0.5, 0.5, 0.0);
    int m = size / 2;
    return vec3(m - index, m, index + 1) / float(size);
}

vec4 source_texel(ivec2 texel);  // the value of a texel of the level above, which the including shader defines

// Value of a texel of the new level: the weighted mean of up to 3 × 3 texels of the level above, which has `size`
// texels.
vec4 downsample(ivec2 texel, ivec2 size) {
    vec3 weights_x = downsample_weights(texel.x, size.x);
    vec3 weights_y = downsample_weights(texel.y, size.y);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) {
            float weight = weights_x[x] * weights_y[y];
            if (weight > 0.0) sum += weight * source_texel(2 * texel + ivec2(x, y));
        }
    }
    return sum;
}
