// Where paths end: the light behind all surfaces, and the mean that each path adds to.
#include "path_sources.glsl"

uniform vec3 ambient;
uniform vec3 background;

// Radiance from behind all surfaces, where the environment has the radiance `sky` and is chosen with `sky_density`.
// Camera rays see the background. Other rays have reached the environment with `density`, while the last surface could
// have chosen it as a source with probability `chance`.
vec3 light_behind(vec3 sky, float sky_density, bool is_camera, float density, float chance) {
#ifdef SHOWS_ENVIRONMENT
    if (is_camera) return sky;
#elif defined(USES_SKY)
    if (is_camera) return background;
#endif
#ifdef USES_ENVIRONMENT
    if (!is_camera) return sky * power_heuristic(density, chance * sky_density);
#elif defined(USES_SKY) && !defined(HAS_ENVIRONMENT)
    if (!is_camera) return ambient;
#endif
    return vec3(0.0);
}

// Adds a batch to the mean and to the sum of squared differences of all (B. P. Welford, 1962).
void add_to_mean(vec4 batch, inout vec4 mean, inout vec4 spread) {
    spread.w += 1.0;
    vec4 difference = batch - mean;
    mean += difference / spread.w;
    spread.rgb += difference.rgb * (batch - mean).rgb;
}
