// Chips of stone in a binder, ground and polished.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 chip_color;
uniform vec3 second_color;
uniform vec3 third_color;
uniform int cells;
uniform float density;
uniform float roughness;

// Adds chips of one size: regions of a cellular noise, shrunk and cut by straight borders, of which some are left out.
void chips(vec2 uv, int count, float share, int salt, inout vec3 base, inout float inside) {
    CellularNoise cell = cellular_noise(uv, ivec2(count), 0.95, salt);
    vec3 random = random3(cell.id, salt + 1), more = random3(cell.id, salt + 2);
    if (random.x > share) return;
    float angle = 6.2831853 * more.x;
    float cut = 0.5 * dot(cell.offset, vec2(cos(angle), sin(angle))) + 0.24 + 0.2 * more.y;
    float border = cellular_edge(cell, uv, ivec2(count), 0.95, salt) - 0.07 - 0.1 * random.y;
    float edge = smoothstep(0.0, 0.035, min(border, cut - 0.12));
    vec3 stone = more.z < 0.5 ? chip_color : more.z < 0.8 ? second_color : third_color;
    float grain = fractal_noise(uv + random.yz, ivec2(count * 2), 3, 0.6, salt + 3);
    base = mix(base, shaded(stone, 0.9 * (random.z - 0.5) + 0.35 * grain), edge);
    inside = max(inside, edge);
}

TextureSample texture_sample(vec2 uv) {
    float fine = fractal_noise(uv, ivec2(64), 3, 0.7, 10);
    float large = fractal_noise(uv, ivec2(3), 4, 0.5, 20);
    vec3 base = shaded(color, 0.12 * fine + 0.15 * large);
    float inside = 0.0;
    chips(uv, cells * 4, 0.55 * density, 100, base, inside);
    chips(uv, cells * 2, 0.6 * density, 200, base, inside);
    chips(uv, cells, 0.7 * density, 300, base, inside);
    TextureSample s = TextureSample(base, 1.0, 0.0, roughness, 0.0);
    s.roughness = clamp(roughness + 0.1 * (1.0 - inside) + 0.06 * large + 0.05 * fine, 0.05, 1.0);
    s.height = 0.0001 * inside + 0.00004 * fine;
    return s;
}
