// Shadow catchers in path tracing. The appearance of a catcher without shadows is known, so paths collect only the
// difference that surfaces make to it. The picture then has no noise where there is no difference (P. Debevec,
// "Rendering Synthetic Objects into Real Scenes", 1998). Without catchers none of this is compiled.
struct CaughtPath {
    bool leaves;    // the previous vertex is on a catcher
    bool is_plain;  // the camera sees the catcher, and it darkens the plain background
};

#if defined(SCENE_ANY_SHADOW_CATCHER) && SOURCES == SOURCES_ALL && !defined(NEEDS_NOTHING)
#include <shadow_catcher.glsl>

// Makes a surface a catcher and returns in `shown` what it shows without shadows; false if it is not a catcher. To the
// camera it shows the background, or white, with `is_plain`, if the background is not the environment. To other
// surfaces, without an environment, it is an ordinary surface.
bool catches_path(inout Surface s, int instance, bool is_camera, out bool is_plain, out vec3 shown) {
    is_plain = false;
    shown = vec3(1.0);
    if ((scene_instance(instance).flags & SCENE_SHADOW_CATCHER) == 0 || s.lit == 0.0) return false;
#ifdef USES_ENVIRONMENT
    vec3 from_all_sides = light_from(s.normal, 2.0);
    shown = light_from(caught_direction(s.position, -s.view_dir), -1e-6);
#else
    vec3 from_all_sides = ambient;
    if (!is_camera) return false;
#endif
#ifndef SHOWS_ENVIRONMENT
    is_plain = is_camera;
    if (is_plain) shown = vec3(1.0);
#endif
    catch_shadows(s, shown, unshadowed_light(s, from_all_sides));
    s.emissive = vec3(0.0);
    float polish = (1.0 - catcher_fade(s.position)) * (is_plain ? 0.0 : 1.0);
    s.f0 = vec3(CATCHER_F0 * polish);
    s.f90 = CATCHER_F90 * polish;
    return true;
}

// Light from behind all surfaces makes no difference to what a catcher shows.
vec3 behind_catcher(CaughtPath caught, vec3 behind) {
    return caught.leaves ? vec3(0.0) : behind;
}

// Light to add where a path from a catcher hits a surface, which blocks light of the environment, and where it hits a
// catcher, which `s` then becomes.
vec3 meet_catcher(
    inout CaughtPath caught, inout Surface s, int instance, vec3 direction, int vertex, float density, float chance) {
    vec3 sum = vec3(0.0), shown;
    bool is_plain;
    if (caught.leaves && is_wanted(vertex - 1)) {
#ifdef USES_ENVIRONMENT
        vec3 sky = light_from(direction, -1e-6);
        sum -= light_behind(sky, environment_density(direction), false, density, chance);
#else
        sum -= light_behind(vec3(0.0), 0.0, false, density, chance);
#endif
    }
    caught.leaves = catches_path(s, instance, vertex == 0, is_plain, shown);
    caught.is_plain = caught.is_plain || is_plain;
    if (caught.leaves && is_wanted(vertex)) sum += shown;
    return sum;
}

// The surface that punctual lights shine on: there are no highlights in what a catcher shows.
Surface lit_catcher(CaughtPath caught, Surface s, bool by_lights) {
    if (caught.leaves && by_lights) {
        s.f0 = vec3(0.0);
        s.f90 = 0.0;
    }
    return s;
}

// Part of a source's light that is already in what the surface shows.
float shown_already(CaughtPath caught, bool is_in_unshadowed) {
    return caught.leaves && is_in_unshadowed ? 1.0 : 0.0;
}

// Where the background is plain, the radiance is what remains of white.
void end_catcher(CaughtPath caught, inout vec3 radiance, inout float coverage) {
    if (caught.is_plain) {
        coverage = 1.0 - luminance_of(radiance);
        radiance *= background;
    }
}
#else
#define behind_catcher(caught, behind) behind
#define meet_catcher(caught, s, instance, direction, vertex, density, chance) vec3(0.0)
#define lit_catcher(caught, s, by_lights) s
#define shown_already(caught, is_in_unshadowed) 0.0
#define end_catcher(caught, radiance, coverage)
#endif
