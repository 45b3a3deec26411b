// Path tracing: light of all sources that arrives by any number of reflections (J. Kajiya, "The Rendering Equation",
// 1986). At each surface one source of light is chosen and tested for shadow, and the path continues in a direction
// that the material samples. Light that both can find is weighted by the power heuristic (E. Veach, "Robust Monte Carlo
// Methods for Light Transport Simulation", 1997).
//
// Each invocation follows the paths of its pixel one after the other in a single loop: one step is one ray and its
// shadow ray, so that neighbours that run in lockstep are busy although their paths have different lengths.
#define SCENE_LAYERS
#define PASSES_LIGHT
#include "path_steps.glsl"

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
    int number = 0;    // of the pixel's path in this step
    uint random = 0u;  // of the batch
    Path path = camera_path(vec2(0.5));
    path.vertex = -1;
    while (number < PATHS) {
        uint point = uint(number % BATCH);
        if (path.vertex < 0) {
            random = hash(pixel, uint(first_path + number - number % BATCH));
#if ANTIALIASING
            vec2 offset = sobol_point(point, random);
#else
            vec2 offset = vec2(0.5);
#endif
            path = camera_path((vec2(texel) + offset) * view.viewport.zw);
        }
        Step now;
        now.ends = true;
        now.reflects = now.may_pass = now.is_back = now.by_light = false;
        now.shown = 0.0;
        now.seen = path.direction;
        now.point = point;
        now.dimension = random + uint(path.vertex) * 8u + path.ahead * 0x10000u;
        Hit hit;
        Surface s;
        bool is_hit = nearest_hit(path.origin, path.direction, path.nearest, path.farthest, hit);
        if (is_hit) meet_surface(path, now, hit, s);

        // The environment, where a ray has found it or where it is the source.
        vec3 sky = vec3(0.0);
        float sky_density = 0.0;
#if defined(SHOWS_ENVIRONMENT) || defined(USES_ENVIRONMENT)
        sky = light_from(now.seen, -1e-6);
#endif
#ifdef USES_ENVIRONMENT
        sky_density = environment_density(now.seen);
#endif
        if (!is_hit) find_background(path, sky, sky_density);
        if (now.reflects) receive_light(path, now, s, hit.instance, sky, sky_density);

        vec2 survival = sobol_point(point, now.dimension + 0x400000u);
        vec3 xi = vec3(sobol_point(point, now.dimension + 0x500000u), survival.x);
#ifdef TRANSMISSION_LAYER
        if (now.may_pass) try_to_pass(path, now, s, hit.instance, xi, survival.y);
#endif
        if (now.reflects) go_on(path, now, s, hit.instance, xi, survival.y);
        if (now.ends) {
            end_catcher(path.caught, path.radiance, path.coverage);
            batch += vec4(path.radiance, path.coverage);
            path.vertex = -1;
            ++number;
            if (number % BATCH == 0) {
                add_to_mean(batch / float(BATCH), mean, spread);
                batch = vec4(0.0);
            }
        }
    }
}
