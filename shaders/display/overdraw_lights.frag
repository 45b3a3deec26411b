// Counts the lights that reach the surface of each pixel.
#include <depth_surface.glsl>
#include <lights.glsl>

out float count;

void main() {
    float window_depth;
    vec3 position = position_at(ivec2(gl_FragCoord.xy), TEXEL_CENTER, window_depth);
    count = 0.0;
    if (is_nothing(window_depth)) return;
#if LIGHT_COUNT > 0
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 light_dir;
        if (any(greaterThan(irradiance_from(lights[i], position, light_dir), vec3(0.0)))) count += 1.0;
    }
#endif
}
