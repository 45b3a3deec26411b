// Directions of rays: points of a low-discrepancy sequence, shifted by a different amount at each pixel, on a disc or a
// hemisphere.
#include <math.glsl>

// Two numbers from 0 to 1 that differ between pixels, and between values of `seed` (PCG hash: M. Jarzynski and M.
// Olano, "Hash Functions for GPU Rendering", 2020).
vec2 random_shift(ivec2 pixel, int seed) {
    uvec3 v = uvec3(pixel, seed) * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    return vec2(v.xy >> 8u) * (1.0 / 16777216.0);
}

// Point i of the R2 sequence in the unit square, moved by `shift`, which wraps around (M. Roberts, "The Unreasonable
// Effectiveness of Quasirandom Sequences", 2018).
vec2 shifted_point(int i, vec2 shift) {
    return fract(shift + float(i) * vec2(0.75487766624669276, 0.56984029099805327));
}

// Uniform on the unit disc.
vec2 point_on_disc(vec2 xi) {
    return sqrt(xi.x) * vec2(cos(2.0 * PI * xi.y), sin(2.0 * PI * xi.y));
}

// Unit vector in the hemisphere around a normal, with a density proportional to its cosine (Malley's method).
vec3 cosine_direction(vec3 normal, vec2 xi) {
    vec2 disc = point_on_disc(xi);
    vec3 tangent = any_tangent(normal);
    return tangent * disc.x + cross(normal, tangent) * disc.y + normal * sqrt(max(1.0 - dot(disc, disc), 0.0));
}

// The largest error, in metres, of float32 coordinates at a point that are interpolated or computed from a depth
// texture. Rays begin this far above their surface. `view_distance` is the point's distance from the viewer, in metres.
// In pictures with few pixels a depth texture is less accurate, because rasterisers snap vertices: see `snapped_by`.
float ray_offset(vec3 position, float view_distance) {
    vec3 size = abs(position);
    return 1e-4 * max(max(size.x, size.y), max(size.z, abs(view_distance)));
}
