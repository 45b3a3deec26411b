// Two colours mixed by fractal noise, with relief: plaster, soil, rock, sackcloth, ripples on water.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 second_color;
uniform int cells;
uniform int octaves;
uniform float gain;
uniform float contrast;
uniform float relief;
uniform float pits;
uniform float roughness;

TextureSample texture_sample(vec2 uv) {
    vec2 bend = vec2(fractal_noise(uv, ivec2(cells), 3, 0.5, 10), fractal_noise(uv, ivec2(cells), 3, 0.5, 20));
    float value = fractal_noise(uv + 0.25 / float(cells) * bend, ivec2(cells), octaves, gain, 30);
    float stains = fractal_noise(uv + 0.1 * bend, ivec2(max(1, cells / 2)), 5, 0.55, 40);
    CellularNoise hole = cellular_noise(uv + 0.006 * bend, ivec2(cells * 10), 1.0, 50);
    float size = random3(hole.id, 51).x;
    float pit = pits * smoothstep(0.42 * size, 0.2 * size, hole.nearest) * step(0.55, size);
    float mixed = clamp(0.5 + contrast * (0.7 * stains + 0.5 * value), 0.0, 1.0);
    TextureSample s = TextureSample(mix(color, second_color, mixed), 1.0, 0.0, 0.0, 0.0);
    s.color = shaded(s.color, 0.18 * contrast * value - 0.6 * pit);
    s.height = relief * (0.5 * value - 0.5 * pit);
    s.roughness = clamp(roughness + 0.08 * value + 0.1 * pit, 0.02, 1.0);
    return s;
}
