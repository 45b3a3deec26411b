// Shadow catchers of paths. What a catcher shows where nothing shadows it is known: paths collect only the difference
// that surfaces make to it, so that the picture is without noise where there is none (P. Debevec, "Rendering Synthetic
// Objects into Real Scenes", 1998).
#if defined(SCENE_ANY_SHADOW_CATCHER) && SOURCES == SOURCES_ALL && !defined(NEEDS_NOTHING)
#define CATCHES_SHADOWS
#include <shadow_catcher.glsl>

// Makes a surface a catcher and returns what it shows without shadows; false if it is none. To the camera it shows what
// the background does, or white with `is_plain`, if that is not the environment. To other surfaces without an
// environment it is a surface like others.
bool catches_path(inout Surface s, int instance, bool is_camera, out bool is_plain, out vec3 shown) {
    is_plain = false;
    shown = vec3(1.0);
    if ((scene_instances[instance].flags & SCENE_SHADOW_CATCHER) == 0 || s.lit == 0.0) return false;
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
#endif
