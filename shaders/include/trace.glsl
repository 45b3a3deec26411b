// Ray tracing in the scene. The step reads an input of `SceneData` with `rays=True`. The trees follow objects that
// move.
#include <scene.glsl>
#include <trace_tree.glsl>

#ifdef SCENE_ANY_MASKED
// Whether an alpha mask has cut away the surface at a hit.
bool trace_is_cut_away(Hit hit) {
    float cutoff = materials[MATERIAL_INDEX(scene_instance(hit.instance).material)].emissive.a;
    return scene_has(hit.instance, SCENE_MASKED) && scene_alpha(hit.instance, hit.triangle, hit.barycentrics) < cutoff;
}
#endif

// The nearest surface along a ray between two distances, at least 0, in lengths of the direction. It finds transparent
// surfaces, too, but neither parts that an alpha mask cuts away nor hidden objects.
bool nearest_hit(vec3 origin, vec3 direction, float nearest, float farthest, out Hit hit) {
#ifdef SCENE_ANY_MASKED
    RayQuery query = ray_query(origin, direction, nearest, farthest, 0, 0, SCENE_MASKED, false);
    while (find_candidate(query)) {
        if (!trace_is_cut_away(query.candidate)) accept_candidate(query);
    }
    hit = query.hit;
    return hit.instance >= 0;
#else
    return trace(origin, direction, nearest, farthest, 0, 0, false, hit);
#endif
}

// The same for a camera ray: it hits what geometry passes draw, so no back faces of one-sided materials.
bool visible_hit(vec3 origin, vec3 direction, float nearest, float farthest, out Hit hit) {
    bool is_hit = nearest_hit(origin, direction, nearest, farthest, hit);
    while (is_hit && !scene_has(hit.instance, SCENE_DOUBLE_SIDED)
            && dot(scene_geometric_normal(hit.instance, hit.triangle), direction) >= 0.0) {
        is_hit = nearest_hit(origin, direction, hit.distance, farthest, hit);
    }
    return is_hit;
}

// Whether anything with all flags in `wanted` lies between two distances. Transparent surfaces do not count.
bool any_hit(vec3 origin, vec3 direction, float nearest, float farthest, int wanted) {
    const int PASSING = SCENE_BLENDED | SCENE_TRANSMITS;
#ifdef SCENE_ANY_MASKED
    RayQuery query = ray_query(origin, direction, nearest, farthest, wanted, PASSING, SCENE_MASKED, true);
    while (find_candidate(query)) {
        if (!trace_is_cut_away(query.candidate)) accept_candidate(query);
    }
    return query.hit.instance >= 0;
#else
    Hit hit;
    return trace(origin, direction, nearest, farthest, wanted, PASSING, true, hit);
#endif
}

// Whether anything casts a shadow between two distances. Transparent surfaces, parts that an alpha mask cuts away, and
// objects that cast no shadows do not count.
bool any_hit(vec3 origin, vec3 direction, float nearest, float farthest) {
    return any_hit(origin, direction, nearest, farthest, SCENE_CASTS_SHADOW);
}
