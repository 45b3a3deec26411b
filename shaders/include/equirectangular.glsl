// Equirectangular maps: u = 0.5 + atan(z, x) / 2π, v = acos(y) / π from the top row.
#include <math.glsl>

// Radiance in a unit direction, averaged over about `angle` radians, from the equirectangular `map`. The sampler
// repeats along u. v is clamped here, so that filtering does not mix the two poles.
vec3 equirectangular_radiance(sampler2D map, vec3 direction, float angle) {
    vec2 size = vec2(textureSize(map, 0));
    float lod = max(log2(max(angle * size.y / PI, 1e-6)), 0.0);
    float margin = 0.5 * exp2(ceil(lod)) / size.y;
    float v = acos(clamp(direction.y, -1.0, 1.0)) / PI;
    // atan(0, 0) is undefined; at the poles any u is right.
    float u = 0.5 + atan(direction.z, abs(direction.x) + abs(direction.z) > 0.0 ? direction.x : 1.0) / (2.0 * PI);
    return textureLod(map, vec2(u, clamp(v, min(margin, 0.5), max(1.0 - margin, 0.5))), lod).rgb;
}
