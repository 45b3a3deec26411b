// Shadows of paths: what masks and transparent surfaces let through counts, too.
#include <trace.glsl>

// Fraction of light that a surface stops: all of it or none with an alpha mask, else as opaque as it is.
float opacity(int instance, int triangle, vec2 barycentrics) {
    float opaque = 1.0;
#if defined(SCENE_ANY_MASKED) || defined(SCENE_ANY_BLENDED)
    int flags = scene_instances[instance].flags;
    if ((flags & (SCENE_MASKED | SCENE_BLENDED)) != 0) {
        float alpha = scene_alpha(instance, triangle, barycentrics);
        float cutoff = materials[MATERIAL_INDEX(scene_instances[instance].material)].emissive.a;
        opaque = (flags & SCENE_MASKED) != 0 ? step(cutoff, alpha) : clamp(alpha, 0.0, 1.0);
    }
#endif
    return opaque;
}

// Fraction of light that arrives from another point.
float visibility(vec3 origin, vec3 direction, float farthest, int wanted) {
    Hit hit;
#if defined(SCENE_ANY_MASKED) || defined(SCENE_ANY_BLENDED)
    const int PASSING = SCENE_MASKED | SCENE_BLENDED;
    float passed = 1.0, nearest = 0.0;
    bool ends;
    while (passed > 0.0 && trace(origin, direction, nearest, farthest, wanted, 0, true, PASSING, hit, ends)) {
        nearest = hit.distance;
        passed *= ends ? 0.0 : 1.0 - opacity(hit.instance, hit.triangle, hit.barycentrics);
    }
    return passed;
#else
    return trace(origin, direction, 0.0, farthest, wanted, 0, true, hit) ? 0.0 : 1.0;
#endif
}
