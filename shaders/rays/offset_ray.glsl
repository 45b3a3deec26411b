// A point beside a surface, so that a ray which leaves there does not hit the surface again: positions are moved along
// the normal by a number of steps of their own precision (C. Wächter and N. Binder, "A Fast and Robust Method for
// Avoiding Self-Intersection", Ray Tracing Gems, 2019). `normal` points to the side that the ray leaves to.
vec3 offset_ray(vec3 position, vec3 normal) {
    const float ORIGIN = 1.0 / 32.0, FLOAT_SCALE = 1.0 / 65536.0, INT_SCALE = 256.0;
    ivec3 steps = ivec3(INT_SCALE * normal);
    vec3 moved = intBitsToFloat(floatBitsToInt(position) + mix(steps, -steps, lessThan(position, vec3(0.0))));
    return mix(moved, position + FLOAT_SCALE * normal, lessThan(abs(position), vec3(ORIGIN)));
}
