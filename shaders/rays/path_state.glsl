// The state of a path, and what happens where its ray hits a surface: light that the surface emits, and the choice of
// one source that lights it.
#include <frame.glsl>
#include "camera_ray.glsl"
#include "path_ends.glsl"
#include "path_lobes.glsl"
#include "path_sources.glsl"
#include "path_visibility.glsl"
#include "path_catchers.glsl"

struct Path {
    int vertex;      // number of surfaces hit; below 0: the path has not begun
    uint ahead;      // surfaces that the ray has passed through
    vec3 throughput;
    vec3 radiance;   // found so far
    float coverage;  // 1 if it has hit a surface
    vec3 origin;     // of the ray
    vec3 direction;
    float nearest;
    float farthest;
    float density;   // of the direction, in 1/sr
    vec3 chances;    // of the sources of light at the previous vertex
    CaughtPath caught;
#ifdef TRANSMISSION_LAYER
    Medium medium;
#endif
};

// One step of a path: a ray, and the shadow ray of the surface that it hits.
struct Step {
    bool ends;
    bool reflects;  // the surface reflects light
    bool may_pass;  // the path may go through the surface
    bool is_back;   // the surface bounds a volume, and the path is inside
    bool by_light;  // the source is a punctual light
    SourceSample source;
    float shown;    // part of the source's light that a shadow catcher shows already
    vec3 seen;      // the direction in which the environment is looked up
    uint point;     // of the low-discrepancy sequence
    uint dimension;
};

// A path of the camera through a point of the picture, 0 to 1.
Path camera_path(vec2 uv) {
    CameraRay ray = camera_ray(uv);
    return Path(0, 0u, vec3(1.0), vec3(0.0), 0.0, ray.origin, ray.direction, ray.nearest, ray.farthest, 0.0, vec3(0.0),
        CaughtPath(false, false)
#ifdef TRANSMISSION_LAYER
        , Medium(vec3(0.0), -1, false)
#endif
    );
}

// Starts the next ray of a path from a surface.
void leave(inout Path path, vec3 origin) {
    path.origin = origin;
    path.nearest = 0.0;
    path.farthest = 1e30;
}

// Adds the emission of the surface that a ray has hit.
void find_emission(inout Path path, Surface s, Hit hit, vec3 front, bool emits) {
#ifdef USES_EMISSION
    bool is_unlit = s.lit == 0.0;
#ifdef NEEDS_NOTHING
    is_unlit = true;
#endif
    if (!is_wanted(path.vertex - 1)) return;
    if (is_unlit) {
        path.radiance += path.throughput * s.base_color;
    } else if (emits) {
        bool is_camera = path.vertex == 0;
        float weight = is_camera ? 1.0 : emission_weight(hit, front, path.direction, path.density, path.chances.z);
        path.radiance += path.throughput * s.emissive * weight;
    }
#endif
}

// Chooses one source of light for a surface.
void choose_source(inout Path path, inout Step now, Surface s) {
    vec2 choice = sobol_point(now.point, now.dimension + 0x100000u);
    float light_chance, lights_sum;
    int light = choose_light(s, choice.y, light_chance, lights_sum);
    path.chances = source_chances(s.position, lights_sum);
    now.shown = shown_already(path.caught, choice.x < path.chances.x + path.chances.y);
    now.by_light = choice.x < path.chances.x;
    now.source = sample_source(s, path.chances, choice.x, light, light_chance, now.point, now.dimension);
    now.seen = now.source.light_dir;
}

// Handles the surface of a hit, or lets the ray pass through it.
void meet_surface(inout Path path, inout Step now, Hit hit, out Surface s) {
    int flags = scene_instance(hit.instance).flags;
    s = scene_surface(hit.instance, hit.triangle, hit.barycentrics, -path.direction);
    vec3 front = scene_geometric_normal(hit.instance, hit.triangle);
    bool is_front = dot(front, path.direction) < 0.0, is_double_sided = (flags & SCENE_DOUBLE_SIDED) != 0;
    // Back faces that geometry passes do not show exist for all rays except the camera's.
    if (!is_front && !is_double_sided) {
        s.normal = -s.normal;
#ifdef CLEARCOAT_LAYER
        s.clearcoat_normal = -s.clearcoat_normal;
#endif
    }
    share_energy(s);
    bool passes = path.vertex == 0 && !is_front && !is_double_sided;
#ifdef TRANSMISSION_LAYER
    passes = passes && !path.medium.has_entered;
    now.is_back = !is_front && is_volume(s);
#endif
#ifdef SCENE_ANY_BLENDED
    passes = passes || unit_float(hash(now.dimension, now.point + 77u)) >= s.alpha;
#endif
    if (passes) {
        path.nearest = hit.distance;
        ++path.ahead;
        now.ends = false;
        return;
    }
    path.coverage = 1.0;
#ifdef TRANSMISSION_LAYER
    path.throughput *= exp(-path.medium.absorption * hit.distance);
#endif
    path.radiance += path.throughput
        * meet_catcher(path.caught, s, hit.instance, path.direction, path.vertex, path.density, path.chances.y);
    find_emission(path, s, hit, front, is_front || is_double_sided);
    bool is_lit = s.lit != 0.0;
#if defined(USES_EMISSION) && defined(NEEDS_NOTHING)
    is_lit = false;
#endif
    now.reflects = is_lit && path.vertex <= LAST_VERTEX && !now.is_back;
#ifdef TRANSMISSION_LAYER
    now.may_pass = is_lit && s.transmission > 0.0 && path.vertex <= LAST_VERTEX + 1;
#endif
    if (now.reflects) choose_source(path, now, s);
}
