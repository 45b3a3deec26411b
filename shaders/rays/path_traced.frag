// Path tracing: light of all sources that arrives by any number of reflections (J. Kajiya, "The Rendering Equation",
// 1986). At each surface one source of light is chosen and tested for shadow, and the path goes on in a direction that
// the material chooses. Light that both can find is weighted by the power heuristic (E. Veach, "Robust Monte Carlo
// Methods for Light Transport Simulation", 1997).
//
// Each invocation follows the paths of its pixel one after the other in a single loop: one step is one ray and its
// shadow ray, so that neighbours that run in lockstep are busy although their paths have different lengths.
#define SCENE_LAYERS
#define TRANSMITS
#include <frame.glsl>
#include "camera_ray.glsl"
#include "path_ends.glsl"
#include "path_lobes.glsl"
#include "path_sources.glsl"
#include "path_visibility.glsl"
#include "path_catchers.glsl"

uniform sampler2D previous_mean;
uniform sampler2D previous_spread;
uniform int seed;
uniform int first_path;  // of this step within the frame
out vec4 mean;           // radiance and coverage
out vec4 spread;         // sum of squared differences of batches to the mean; number of batches

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    View view = PASS_VIEW;
    bool continues = first_path > 0 || still_frames > 0;
    mean = continues ? texelFetch(previous_mean, texel, 0) : vec4(0.0);
    spread = continues ? texelFetch(previous_spread, texel, 0) : vec4(0.0);
    uint pixel = hash(hash(uint(texel.x), uint(texel.y)), hash(uint(seed), uint(frame_index)));

    vec4 batch = vec4(0.0);
    int path = 0;        // of this pixel in this step
    int vertex = -1;     // surfaces that the path has met; below 0 it has to begin
    uint random = 0u;    // of the batch
    uint ahead = 0u;     // surfaces that the ray has passed through
    vec3 throughput = vec3(1.0), radiance = vec3(0.0), origin = vec3(0.0), direction = vec3(0.0, 0.0, 1.0);
    float nearest = 0.0, farthest = 1e30, density = 0.0, coverage = 0.0;
    vec3 chances = vec3(0.0);  // at the vertex before
    CaughtPath caught = CaughtPath(false, false);
#ifdef TRANSMISSION_LAYER
    Medium medium = Medium(vec3(0.0), -1, false);
#endif
    while (path < PATHS) {
        uint point = uint(path % BATCH);
        if (vertex < 0) {
            random = hash(pixel, uint(first_path + path - path % BATCH));
#if ANTIALIASING
            vec2 offset = sobol_point(point, random);
#else
            vec2 offset = vec2(0.5);
#endif
            CameraRay ray = camera_ray((vec2(texel) + offset) * view.viewport.zw);
            origin = ray.origin;
            direction = ray.direction;
            nearest = ray.nearest;
            farthest = ray.farthest;
            throughput = vec3(1.0);
            radiance = vec3(0.0);
            coverage = 0.0;
            density = 0.0;
            vertex = 0;
            caught = CaughtPath(false, false);
#ifdef TRANSMISSION_LAYER
            medium = Medium(vec3(0.0), -1, false);
#endif
        }
        uint dimension = random + uint(vertex) * 8u + ahead * 0x10000u;
        bool ends = true, reflects = false, by_light = false, is_back = false, may_pass = false;
        Hit hit;
        Surface s;
        SourceSample source;
        vec3 start, seen = direction;
        float shown = 0.0;  // part of the light of the source that a shadow catcher shows already
        bool is_hit = trace(origin, direction, nearest, farthest, 0, 0, false, hit);
        if (is_hit) {
            int flags = scene_instances[hit.instance].flags;
            s = scene_surface(hit.instance, hit.triangle, hit.barycentrics, -direction);
            vec3 front = scene_geometric_normal(hit.instance, hit.triangle);
            bool is_front = dot(front, direction) < 0.0, is_double_sided = (flags & SCENE_DOUBLE_SIDED) != 0;
            // A back that geometry passes do not show is there for all rays but the camera's.
            if (!is_front && !is_double_sided) {
                s.normal = -s.normal;
#ifdef CLEARCOAT_LAYER
                s.clearcoat_normal = -s.clearcoat_normal;
#endif
            }
            share_energy(s);
            bool passes = vertex == 0 && !is_front && !is_double_sided;
#ifdef TRANSMISSION_LAYER
            passes = passes && !medium.has_entered;
            is_back = !is_front && is_volume(s);
#endif
#ifdef SCENE_ANY_MASKED
            float cutoff = materials[MATERIAL_INDEX(scene_instances[hit.instance].material)].emissive.a;
            float alpha = scene_alpha(hit.instance, hit.triangle, hit.barycentrics);
            passes = passes || ((flags & SCENE_MASKED) != 0 && alpha < cutoff);
#endif
#ifdef SCENE_ANY_BLENDED
            passes = passes || unit_float(hash(dimension, point + 77u)) >= s.alpha;
#endif
            bool is_unlit = s.lit == 0.0;
            if (passes) {
                nearest = hit.distance;
                ++ahead;
                ends = false;
            } else {
                coverage = 1.0;
#ifdef TRANSMISSION_LAYER
                throughput *= exp(-medium.absorption * hit.distance);
#endif
                radiance += throughput * meet_catcher(caught, s, hit.instance, direction, vertex, density, chances.y);
#ifdef USES_EMISSION
#ifdef NEEDS_NOTHING
                is_unlit = true;
#endif
                if (is_wanted(vertex - 1)) {
                    if (is_unlit) {
                        radiance += throughput * s.base_color;
                    } else if (is_front || is_double_sided) {
                        float weight = vertex > 0 ? emission_weight(hit, front, direction, density, chances.z) : 1.0;
                        radiance += throughput * s.emissive * weight;
                    }
                }
#endif
                reflects = !is_unlit && vertex <= LAST_VERTEX && !is_back;
#ifdef TRANSMISSION_LAYER
                may_pass = !is_unlit && s.transmission > 0.0 && vertex <= LAST_VERTEX + 1;
#endif
            }
            if (reflects) {  // one source of light
                vec2 choice = sobol_point(point, dimension + 0x100000u);
                float light_chance, lights_sum;
                int light = choose_light(s, choice.y, light_chance, lights_sum);
                chances = source_chances(s.position, lights_sum);
                shown = shown_already(caught, choice.x < chances.x + chances.y);
                by_light = choice.x < chances.x;
                source = sample_source(s, chances, choice.x, light, light_chance, point, dimension);
                seen = source.light_dir;
            }
        }

        // The environment, where a ray has found it or where it is the source.
        vec3 sky = vec3(0.0);
        float sky_density = 0.0;
#if defined(SHOWS_ENVIRONMENT) || defined(USES_ENVIRONMENT)
        sky = light_from(seen, -1e-6);
#endif
#ifdef USES_ENVIRONMENT
        sky_density = environment_density(seen);
#endif
        if (!is_hit) {
            vec3 behind =
                behind_catcher(caught, light_behind(sky, sky_density, vertex == 0, density, chances.y));
            if (is_wanted(vertex - 1)) radiance += throughput * behind;
#ifdef TRANSMISSION_LAYER
            if (vertex == 0) coverage = 0.0;  // it has passed through everything
#endif
        }
        if (reflects) {
            if (source.is_environment) {
                source.density = chances.y * sky_density;
                source.light = source.density > 0.0 ? sky * (SPREAD_LIGHT / source.density) : vec3(0.0);
            }
            vec3 arriving = source.light * reflected_part(lit_catcher(caught, s, by_light), source.light_dir);
            if (source.density > 0.0) {
                arriving *= power_heuristic(source.density, reflected_density(s, source.light_dir));
            }
            float side = 1.0;
#ifdef TRANSMISSION_LAYER
            if (dot(source.ray, s.geometric_normal) < 0.0 && by_light) {
                side = -1.0;
                arriving = source.light * thin_transmission(s, source.light_dir);
            }
#endif
            start = offset_ray(hit.instance, s.position, side * s.geometric_normal);
            if (source.reach == 1.0) source.ray += s.position - start;
            bool reaches = side * dot(source.ray, s.geometric_normal) > 0.0 && is_wanted(vertex)
                && max(max(arriving.x, arriving.y), arriving.z) > 0.0;
            vec3 passed = visibility(start, source.ray, reaches ? source.reach : 0.0, source.casting) - shown;
            if (reaches) radiance += throughput * arriving * passed;

        }

        // The next ray.
        vec2 survival = sobol_point(point, dimension + 0x400000u);
        vec3 xi = vec3(sobol_point(point, dimension + 0x500000u), survival.x);
#ifdef TRANSMISSION_LAYER
        if (may_pass) {
            float chance = is_back ? 1.0 : transmission_chance(s);
            bool goes_through = xi.z < chance;
            xi.z = goes_through ? xi.z / chance : (xi.z - chance) / max(1.0 - chance, 1e-7);
            if (goes_through) {
                bool is_inside;
                vec3 left = pass_through(s, is_back, xi, medium, direction, is_inside) / chance;
                throughput *= left;
                float side = is_inside ? 1.0 : -1.0, strongest = max(max(throughput.x, throughput.y), throughput.z);
                float survives = ahead > 8u ? min(strongest, 0.95) : 1.0;
                ends = !(side * dot(direction, s.geometric_normal) > 0.0 && strongest > 0.0 && ahead < 64u
                    && survival.y < survives);
                throughput /= max(survives, 1e-6);
                origin = offset_ray(hit.instance, s.position, side * s.geometric_normal);
                nearest = 0.0;
                farthest = 1e30;
                medium.has_entered = true;
                ++ahead;
                chances = vec3(0.0);  // nothing else finds light through the surface
                density = 1.0;
                reflects = false;
            }
        }
#endif
        if (reflects) {
            start = offset_ray(hit.instance, s.position, s.geometric_normal);
            direction = reflected_direction(s, xi);
            density = reflected_density(s, direction);
            bool goes_on = dot(direction, s.geometric_normal) > 0.0 && density > 0.0;
            throughput *= reflected_part(s, direction) * (SPREAD_LIGHT / max(density, 1e-37));
            float strongest = max(max(throughput.x, throughput.y), throughput.z);
            if (vertex >= 3) {  // Russian roulette
                float survives = min(strongest, 0.95);
                goes_on = goes_on && survival.y < survives;
                throughput /= max(survives, 1e-6);
            }
            goes_on = goes_on && strongest > 0.0;
#ifndef FOLLOWS_LAST
            goes_on = goes_on && vertex < LAST_VERTEX;
#endif
            if (goes_on) {
                origin = start;
                nearest = 0.0;
                farthest = 1e30;
                ++vertex;
                ends = false;
            }
        }
        if (ends) {
            end_catcher(caught, radiance, coverage);
            batch += vec4(radiance, coverage);
            vertex = -1;
            ahead = 0u;
            ++path;
            if (path % BATCH == 0) {
                add_to_mean(batch / float(BATCH), mean, spread);
                batch = vec4(0.0);
            }
        }
    }
}
