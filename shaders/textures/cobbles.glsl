// Round stones set in sand, as in a pavement or a river bed.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 second_color;
uniform vec3 sand_color;
uniform int cells;
uniform float gap;
uniform float spread;
uniform float variation;
uniform float relief;
uniform float roughness;

TextureSample texture_sample(vec2 uv) {
    vec2 bend = vec2(fractal_noise(uv, ivec2(cells), 3, 0.5, 10), fractal_noise(uv, ivec2(cells), 3, 0.5, 20));
    vec2 p = uv + 0.07 / float(cells) * bend;
    CellularNoise cell = cellular_noise(p, ivec2(cells), spread, 30);
    vec3 random = random3(cell.id, 31), more = random3(cell.id, 32);
    float rough = fractal_noise(uv, ivec2(32), 5, 0.6, 40);
    float large = fractal_noise(uv, ivec2(4), 4, 0.5, 50);
    float inside = cellular_edge(cell, p, ivec2(cells), spread, 30) - 0.5 * gap + 0.02 * rough;
    float edge = smoothstep(0.0, 0.05, inside);
    float dome = 1.0 - exp2(-12.0 * max(inside, 0.0));
    dome *= 1.0 - 0.55 * min(cell.nearest * cell.nearest, 1.0);
    float top = 0.85 + 0.3 * (random.z - 0.5);
    vec3 stone = mix(color, second_color, smoothstep(0.35, 0.65, random.x));
    stone = shaded(stone, variation * (1.2 * (more.x - 0.5) + 0.5 * rough + 0.25 * large) - 0.4 * (1.0 - dome));
    float grit = fractal_noise(uv, ivec2(96), 2, 0.7, 60);
    TextureSample s = TextureSample(mix(shaded(sand_color, 0.6 * grit - 0.4), stone, edge), 1.0, 0.0, 0.0, 0.0);
    float lying = 0.3 * dot(cell.offset, more.yz - 0.5);
    s.height = relief * (edge * (top * dome + lying) + 0.06 * rough + 0.06 * grit * (1.0 - edge));
    s.roughness = clamp(mix(0.97, roughness + 0.2 * (1.0 - dome) + 0.1 * rough, edge), 0.05, 1.0);
    return s;
}
