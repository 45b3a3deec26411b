// How many lights reach the surface of a pixel.
#include <depth_surface.glsl>
#include <lights.glsl>

out float count;

void main() {
    float d;
    vec3 position = position_at(ivec2(gl_FragCoord.xy), TEXEL_CENTER, d);
    count = 0.0;
    if (is_nothing(d)) return;
#if LIGHT_COUNT > 0
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 to_light;
        if (any(greaterThan(irradiance_from(lights[i], position, to_light), vec3(0.0)))) count += 1.0;
    }
#endif
}
