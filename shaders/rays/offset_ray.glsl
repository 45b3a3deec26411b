// A point beside a surface, so that a ray which leaves there does not hit the surface again: positions are moved along
// the normal by a number of steps of their own precision (C. Wächter and N. Binder, "A Fast and Robust Method for
// Avoiding Self-Intersection", Ray Tracing Gems, 2019). Small coordinates beside large ones are as imprecise as those,
// because rays are sheared. `normal` points to the side that the ray leaves to.
vec3 offset_ray(vec3 position, vec3 normal) {
    const float ORIGIN = 1.0 / 32.0, FLOAT_SCALE = 1.0 / 65536.0, INT_SCALE = 256.0, FAR_SCALE = 1.0 / 1048576.0;
    ivec3 steps = ivec3(INT_SCALE * normal);
    vec3 moved = intBitsToFloat(floatBitsToInt(position) + mix(steps, -steps, lessThan(position, vec3(0.0))));
    vec3 size = abs(position);
    vec3 least = mix(vec3(0.0), vec3(FLOAT_SCALE), lessThan(size, vec3(ORIGIN)));
    least = max(least, FAR_SCALE * max(max(size.x, size.y), size.z));
    return mix(moved, position + least * normal, lessThan(size * FLOAT_SCALE, least));
}
