#version 430
layout(local_size_x = 8, local_size_y = 8) in;
uniform sampler2D source;
uniform writeonly image2D level;
uniform int above;

// Over an odd side of 2m + 1 texels each of the m below covers 2 + 1/m of them (Guthe and Heckbert 2005).
vec3 weights(int index, int size) {
    if (size == 1) return vec3(1.0, 0.0, 0.0);
    if (size % 2 == 0) return vec3(0.5, 0.5, 0.0);
    return vec3(size / 2 - index, size / 2, index + 1) / float(size);
}

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = textureSize(source, above);
    if (any(greaterThanEqual(texel, imageSize(level)))) return;
    ivec2 taps = ivec2(size.x == 1 ? 1 : 2 + size.x % 2, size.y == 1 ? 1 : 2 + size.y % 2);
    vec3 across = weights(texel.x, size.x), down = weights(texel.y, size.y);
    vec4 mean = vec4(0.0);
    for (int y = 0; y < taps.y; ++y) {
        for (int x = 0; x < taps.x; ++x) {
            mean += across[x] * down[y] * texelFetch(source, 2 * texel + ivec2(x, y), above);
        }
    }
    imageStore(level, texel, mean);
}
