// The rest of a step of a path, after its ray has hit something: light of the chosen source, and the next ray.
#include "path_state.glsl"

// Adds the light of the source that a surface has chosen, if it reaches the surface.
void receive_light(inout Path path, inout Step now, Surface s, int instance, vec3 sky, float sky_density) {
    if (now.source.is_environment) {
        now.source.density = path.chances.y * sky_density;
        now.source.light = now.source.density > 0.0 ? sky * (SPREAD_LIGHT / now.source.density) : vec3(0.0);
    }
    vec3 light_dir = now.source.light_dir;
    vec3 arriving = now.source.light * reflected_part(lit_catcher(path.caught, s, now.by_light), light_dir);
    if (now.source.density > 0.0) arriving *= power_heuristic(now.source.density, reflected_density(s, light_dir));
    float side = 1.0;
#ifdef TRANSMISSION_LAYER
    if (dot(now.source.ray, s.geometric_normal) < 0.0 && now.by_light) {
        side = -1.0;
        arriving = now.source.light * thin_transmission(s, light_dir);
    }
#endif
    vec3 start = offset_ray(instance, s.position, side * s.geometric_normal);
    if (now.source.reach == 1.0) now.source.ray += s.position - start;
    bool reaches = side * dot(now.source.ray, s.geometric_normal) > 0.0 && is_wanted(path.vertex)
        && max(max(arriving.x, arriving.y), arriving.z) > 0.0;
    vec3 passed = visibility(start, now.source.ray, reaches ? now.source.reach : 0.0, now.source.casting) - now.shown;
    if (reaches) path.radiance += path.throughput * arriving * passed;
}

// Adds the light behind all surfaces, which a ray has reached.
void find_background(inout Path path, vec3 sky, float sky_density) {
    vec3 found = light_behind(sky, sky_density, path.vertex == 0, path.density, path.chances.y);
    vec3 behind = behind_catcher(path.caught, found);
    if (is_wanted(path.vertex - 1)) path.radiance += path.throughput * behind;
#ifdef TRANSMISSION_LAYER
    if (path.vertex == 0) path.coverage = 0.0;  // it has passed through everything
#endif
}

#ifdef TRANSMISSION_LAYER
// Sends a path through the surface with the probability of transmission; `xi.z` is used and then rescaled for reuse.
void try_to_pass(inout Path path, inout Step now, Surface s, int instance, inout vec3 xi, float survival) {
    float chance = now.is_back ? 1.0 : transmission_chance(s);
    bool goes_through = xi.z < chance;
    xi.z = goes_through ? xi.z / chance : (xi.z - chance) / max(1.0 - chance, 1e-7);
    if (!goes_through) return;
    bool is_inside;
    vec3 left = pass_through(s, now.is_back, xi, path.medium, path.direction, is_inside) / chance;
    path.throughput *= left;
    float side = is_inside ? 1.0 : -1.0;
    float strongest = max(max(path.throughput.x, path.throughput.y), path.throughput.z);
    float survives = path.ahead > 8u ? min(strongest, 0.95) : 1.0;
    now.ends = !(side * dot(path.direction, s.geometric_normal) > 0.0 && strongest > 0.0 && path.ahead < 64u
        && survival < survives);
    path.throughput /= max(survives, 1e-6);
    leave(path, offset_ray(instance, s.position, side * s.geometric_normal));
    path.medium.has_entered = true;
    ++path.ahead;
    path.chances = vec3(0.0);  // no other strategy finds light through the surface
    path.density = 1.0;
    now.reflects = false;
}
#endif

// Continues a path in a direction that the surface samples, unless it ends here.
void go_on(inout Path path, inout Step now, Surface s, int instance, vec3 xi, float survival) {
    vec3 start = offset_ray(instance, s.position, s.geometric_normal);
    path.direction = reflected_direction(s, xi);
    path.density = reflected_density(s, path.direction);
    bool goes_on = dot(path.direction, s.geometric_normal) > 0.0 && path.density > 0.0;
    path.throughput *= reflected_part(s, path.direction) * (SPREAD_LIGHT / max(path.density, 1e-37));
    float strongest = max(max(path.throughput.x, path.throughput.y), path.throughput.z);
    if (path.vertex >= 3) {  // Russian roulette
        float survives = min(strongest, 0.95);
        goes_on = goes_on && survival < survives;
        path.throughput /= max(survives, 1e-6);
    }
    goes_on = goes_on && strongest > 0.0;
#ifndef FOLLOWS_LAST
    goes_on = goes_on && path.vertex < LAST_VERTEX;
#endif
    if (!goes_on) return;
    leave(path, start);
    ++path.vertex;
    now.ends = false;
}
