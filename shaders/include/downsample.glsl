// One level of a mip chain from the level above, at any size. A level has half the texels of the one above, rounded
// down; over an odd side of 2m + 1 each of the m texels covers 2 + 1/m, so three are weighted by the covered part
// (S. Guthe and P. Heckbert, "Non-Power-of-Two Mipmap Creation", 2005). Every level keeps the mean of the one above.

// Weights of up to three taps from 2 * index on, along a side of `size` texels above.
vec3 downsample_weights(int index, int size) {
    if (size == 1) return vec3(1.0, 0.0, 0.0);
    if (size % 2 == 0) return vec3(0.5, 0.5, 0.0);
    int m = size / 2;
    return vec3(m - index, m, index + 1) / float(size);
}

vec4 source_texel(ivec2 texel);  // a texel of the level above: the including shader says what of it

vec4 downsample(ivec2 texel, ivec2 size) {
    vec3 across = downsample_weights(texel.x, size.x);
    vec3 up = downsample_weights(texel.y, size.y);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) {
            float weight = across[x] * up[y];
            if (weight > 0.0) sum += weight * source_texel(2 * texel + ivec2(x, y));
        }
    }
    return sum;
}
