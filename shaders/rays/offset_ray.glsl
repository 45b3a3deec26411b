// Moves the origin of a ray off a surface, so that the ray does not hit the surface again: positions are moved along
// the normal by a number of steps of their own precision (C. Wächter and N. Binder, "A Fast and Robust Method for
// Avoiding Self-Intersection", Ray Tracing Gems, 2019). Small coordinates beside large ones are as imprecise as those,
// because rays are sheared, and all are as imprecise as those of the object's corners that they are interpolated from:
// these replace the constant of the article, which only suits scenes of some metres. `normal` points to the side to
// which the ray leaves.
vec3 offset_ray(int instance, vec3 position, vec3 normal) {
    const float INT_SCALE = 256.0, FAR_SCALE = 1.0 / 1048576.0, CORNER_SCALE = 1.0 / 4194304.0;
    ivec3 steps = ivec3(INT_SCALE * normal);
    vec3 moved = intBitsToFloat(floatBitsToInt(position) + mix(steps, -steps, lessThan(position, vec3(0.0))));
    vec3 size = abs(position);
    vec3 corner = abs(scene_instance(instance).box_center.xyz) + scene_instance(instance).box_extent.xyz;
    float least = FAR_SCALE * max(max(size.x, size.y), size.z);
    least = max(least, CORNER_SCALE * max(max(corner.x, corner.y), corner.z));
    return mix(moved, position + least * normal, lessThan(size * (1.0 / 65536.0), vec3(least)));
}
