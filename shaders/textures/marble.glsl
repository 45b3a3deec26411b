// Polished marble: clouds and veins of several widths, bent by noise.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 vein_color;
uniform int cells;
uniform float veins;
uniform float roughness;

// A line where noise is 0, about `width` wide in values of the noise.
float line(vec2 uv, int count, float width, int salt) {
    float value = fractal_noise(uv, ivec2(count), 5, 0.48, salt);
    return 1.0 - smoothstep(0.0, width, abs(value));
}

TextureSample texture_sample(vec2 uv) {
    vec2 bend = vec2(fractal_noise(uv, ivec2(cells), 4, 0.5, 10), fractal_noise(uv, ivec2(cells), 4, 0.5, 20));
    vec2 p = uv + 0.16 / float(cells) * bend * 3.0;
    float clouds = fractal_noise(p, ivec2(cells), 6, 0.55, 30);
    float strength = 0.5 + 0.5 * fractal_noise(uv, ivec2(cells), 3, 0.5, 40);
    float wide = line(p, cells, 0.09, 50) * smoothstep(0.3, 0.8, strength);
    float thin = line(p, cells * 2, 0.022, 60) * smoothstep(0.2, 0.6, strength);
    float hair = line(p + 0.02 * bend, cells * 4, 0.012, 70) * smoothstep(0.45, 0.8, strength);
    float vein = clamp(veins * (0.65 * wide * wide + 0.8 * thin + 0.45 * hair), 0.0, 1.0);
    float fine = fractal_noise(uv, ivec2(64), 3, 0.6, 80);
    vec3 base = shaded(color, 0.22 * clouds - 0.05 + 0.04 * fine);
    base = mix(base, mix(base, vein_color, 0.45), smoothstep(-0.1, 0.6, -clouds) * 0.6 * veins);
    base = mix(base, shaded(vein_color, 0.3 * clouds), vein);
    TextureSample s = TextureSample(base, 1.0, 0.0, 0.0, 0.0);
    s.height = 0.00005 * fine - 0.0002 * vein * thin;
    s.roughness = clamp(roughness + 0.12 * vein + 0.05 * clouds + 0.04 * fine, 0.05, 1.0);
    return s;
}
