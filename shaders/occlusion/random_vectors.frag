// A random unit vector and a random number from -1 to 1 in each texel, the same in every run.
// Hash: M. Jarzynski and M. Olano, "Hash Functions for GPU Rendering", 2020 (pcg3d).
#include <math.glsl>

out vec4 noise;

void main() {
    uvec3 h = uvec3(gl_FragCoord.xy, 7u) * 1664525u + 1013904223u;
    for (int i = 0; i < 2; ++i) {
        h.x += h.y * h.z;
        h.y += h.z * h.x;
        h.z += h.x * h.y;
        h ^= h >> 16u;
    }
    vec3 random = vec3(h >> 8u) / 16777216.0;
    float cos_theta = random.x * 2.0 - 1.0;
    float phi = 2.0 * PI * random.y;
    noise = vec4(sqrt(1.0 - cos_theta * cos_theta) * vec2(cos(phi), sin(phi)), cos_theta, random.z * 2.0 - 1.0);
}
