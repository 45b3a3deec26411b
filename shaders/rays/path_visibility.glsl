// Shadows in path tracing, including light that alpha masks and transparent surfaces let through.
#include <passing_light.glsl>
#include <trace.glsl>

// Fraction of light that a surface stops: all or nothing with an alpha mask, otherwise its opacity.
float opacity(int instance, int triangle, vec2 barycentrics) {
    float opaque = 1.0;
#if defined(SCENE_ANY_MASKED) || defined(SCENE_ANY_BLENDED)
    int flags = scene_instance(instance).flags;
    if ((flags & (SCENE_MASKED | SCENE_BLENDED)) != 0) {
        float alpha = scene_alpha(instance, triangle, barycentrics);
        float cutoff = materials[MATERIAL_INDEX(scene_instance(instance).material)].emissive.a;
        opaque = (flags & SCENE_MASKED) != 0 ? step(cutoff, alpha) : clamp(alpha, 0.0, 1.0);
    }
#endif
    return opaque;
}

// Fraction of light that arrives from another point. Light that casts shadows (SCENE_CASTS_SHADOW in `wanted`) is that
// of punctual lights. Refracted paths cannot hit those, so their light passes straight through transmissive surfaces.
vec3 visibility(vec3 origin, vec3 direction, float farthest, int wanted) {
#if defined(SCENE_ANY_MASKED) || defined(SCENE_ANY_BLENDED) || defined(TRANSMISSION_LAYER)
    int asks = SCENE_MASKED | SCENE_BLENDED | (wanted != 0 ? SCENE_TRANSMITS : 0);
    RayQuery query = ray_query(origin, direction, 0.0, farthest, wanted, 0, asks, true);
    vec3 passed = vec3(1.0);
    while (max(max(passed.r, passed.g), passed.b) > 0.0 && find_candidate(query)) {
        Hit hit = query.candidate;
        vec3 stopped = vec3(opacity(hit.instance, hit.triangle, hit.barycentrics));
#ifdef TRANSMISSION_LAYER
        if (wanted != 0 && scene_has(hit.instance, SCENE_TRANSMITS)) stopped *= 1.0 - passing_light(hit);
#endif
        passed *= 1.0 - stopped;
    }
    return query.hit.instance >= 0 ? vec3(0.0) : passed;
#else
    Hit hit;
    return trace(origin, direction, 0.0, farthest, wanted, 0, true, hit) ? vec3(0.0) : vec3(1.0);
#endif
}
