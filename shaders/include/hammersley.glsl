// Low-discrepancy points in the unit square (Hammersley 1960), and GGX half vectors sampled with them.
#include <math.glsl>

// Point `i` of `count` in the unit square, from 0 to 1.
vec2 hammersley(int i, int count) {
    return vec2((float(i) + 0.5) / float(count), float(bitfieldReverse(uint(i))) * 2.3283064365386963e-10);
}

// Half vector in tangent space (z is the normal) with density D(NoH) NoH, from a point `xi` in the unit square.
vec3 ggx_half_vector(vec2 xi, float alpha) {
    float cos_theta = sqrt((1.0 - xi.x) / (1.0 + (alpha * alpha - 1.0) * xi.x));
    float sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
    return vec3(sin_theta * cos(2.0 * PI * xi.y), sin_theta * sin(2.0 * PI * xi.y), cos_theta);
}
