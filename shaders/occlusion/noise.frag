// A unit vector and a number between -1 and 1 at each texel, random but the same every time.
// Hash: M. Jarzynski and M. Olano, "Hash Functions for GPU Rendering", 2020 (pcg3d).
#include <math.glsl>

out vec4 noise;

void main() {
    uvec3 h = uvec3(gl_FragCoord.xy, 7u) * 1664525u + 1013904223u;
    for (int turn = 0; turn < 2; ++turn) {
        h.x += h.y * h.z;
        h.y += h.z * h.x;
        h.z += h.x * h.y;
        h ^= h >> 16u;
    }
    vec3 random = vec3(h >> 8u) / 16777216.0;
    float up = random.x * 2.0 - 1.0;
    float around = 2.0 * PI * random.y;
    noise = vec4(sqrt(1.0 - up * up) * vec2(cos(around), sin(around)), up, random.z * 2.0 - 1.0);
}
