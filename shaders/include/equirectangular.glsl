// Pictures of everything around: u = 0.5 + atan(z, x) / 2 pi, v = acos(y) / pi from the top row.
#include <math.glsl>

// Radiance in a unit direction, averaged over about `angle` radians. The sampler repeats; rows must not, so that the
// poles stay apart.
vec3 equirectangular_radiance(sampler2D picture, vec3 direction, float angle) {
    vec2 size = vec2(textureSize(picture, 0));
    float lod = max(log2(max(angle * size.y / PI, 1e-6)), 0.0);
    float edge = 0.5 * exp2(ceil(lod)) / size.y;
    float v = acos(clamp(direction.y, -1.0, 1.0)) / PI;
    // atan has no answer at the poles, where any will do.
    float u = 0.5 + atan(direction.z, abs(direction.x) + abs(direction.z) > 0.0 ? direction.x : 1.0) / (2.0 * PI);
    return textureLod(picture, vec2(u, clamp(v, min(edge, 0.5), max(1.0 - edge, 0.5))), lod).rgb;
}
