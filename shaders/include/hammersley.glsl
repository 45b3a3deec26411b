// Points that fill the unit square evenly (Hammersley 1960), and GGX half vectors of them.
#include <math.glsl>

vec2 hammersley(int i, int count) {
    return vec2((float(i) + 0.5) / float(count), float(bitfieldReverse(uint(i))) * 2.3283064365386963e-10);
}

// A half vector about +Z with density D (N.H).
vec3 ggx_half_vector(vec2 point, float alpha) {
    float cosine = sqrt((1.0 - point.x) / (1.0 + (alpha * alpha - 1.0) * point.x));
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return vec3(sine * cos(2.0 * PI * point.y), sine * sin(2.0 * PI * point.y), cosine);
}
