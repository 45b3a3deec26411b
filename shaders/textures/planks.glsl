// Boards along u, each from a different piece of wood, with grain, knots and joints.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 dark_color;
uniform int rows;
uniform int columns;
uniform float gap;
uniform float variation;
uniform float relief;
uniform float roughness;

// Grain of one board: `p` in widths of a board, along it and across; 0 is early wood and 1 is late wood.
float grain(vec2 p, ivec2 period, float center, int salt, out float knot) {
    vec2 bend = vec2(0.0, 0.16 * fractal_noise(p / vec2(period), period * ivec2(1, 2), 2, 0.5, salt));
    CellularNoise knots = cellular_noise(p / vec2(period), max(period / ivec2(2, 1), ivec2(1)), 0.7, salt + 5);
    vec3 random = random3(knots.id, salt + 6);
    float reach = random.x > 0.62 ? 0.16 + 0.16 * random.y : 0.0;
    vec2 away = knots.offset * vec2(2.0, 1.0);
    float near = reach > 0.0 ? exp(-dot(away * vec2(0.55, 1.0), away * vec2(0.55, 1.0)) / (reach * reach)) : 0.0;
    knot = reach > 0.0 ? smoothstep(0.34 * reach, 0.2 * reach, length(away)) : 0.0;
    // Rings of a trunk that is cut along its axis: fibres flow around knots.
    float across = p.y - center + bend.y + 0.55 * near * sign(away.y + 1e-4) * 0.5;
    float depth = 0.35 + 0.2 * fractal_noise(p / vec2(period), max(period / 4, ivec2(1)), 2, 0.5, salt + 7);
    float radius = length(vec2(across, depth));
    radius = mix(radius, 0.4 * length(away) + 0.3, smoothstep(0.35, 0.9, near));
    float ring = fract(radius * 9.0 + 0.12 * fractal_noise(p / vec2(period), period * ivec2(2, 12), 2, 0.5, salt + 8));
    return smoothstep(0.05, 0.85, ring) * (1.0 - smoothstep(0.9, 1.0, ring));
}

TextureSample texture_sample(vec2 uv) {
    float row = floor(uv.y * float(rows));
    vec3 of_row = random3(ivec2(0, row), 3);
    float u = uv.x * float(columns) + of_row.x;
    ivec2 board = ivec2(mod(floor(u), float(columns)), row);
    vec3 random = random3(board, 1), more = random3(board, 2);
    vec2 within = vec2(fract(u), fract(uv.y * float(rows)));
    vec2 unit = vec2(1.0 / float(columns), 1.0 / float(rows));
    vec2 from_edge = (0.5 - abs(within - 0.5)) * unit;
    float outline = min(from_edge.x, from_edge.y);
    // Each board looks up wood at a different place; the period keeps it seamless where the tile repeats.
    ivec2 period = ivec2(max(2, rows), rows);
    vec2 p = vec2(uv.x * float(period.x), uv.y * float(period.y)) + floor(random.xy * vec2(period));
    float knot;
    float late = grain(p, period, p.y - within.y + mix(-0.4, 1.4, more.x), 100 + int(64.0 * random.z), knot);
    float fibre = fractal_noise(uv, ivec2(8, 96 * rows / 4), 4, 0.7, 50 + board.y);
    float pores = smoothstep(0.25, 0.6, fractal_noise(uv, ivec2(24, 64 * rows), 2, 0.5, 60));
    float large = fractal_noise(uv, ivec2(3, rows), 3, 0.5, 70);
    float edge = smoothstep(0.25 * gap, 0.75 * gap, outline);
    float bevel = smoothstep(0.3 * gap, 2.0 * gap, outline);
    float wood = clamp(0.62 * late + 0.16 * fibre + 0.1, 0.0, 1.0);
    vec3 base = mix(color, dark_color, wood);
    base *= mix(vec3(1.0), vec3(1.1, 0.97, 0.85), variation * (more.y - 0.3));
    base = shaded(base, variation * (1.1 * (random.z - 0.5) + 0.3 * large) + 0.12 * fibre - 0.35 * pores);
    base = mix(base, 0.4 * dark_color, 0.85 * knot);
    TextureSample s = TextureSample(base * mix(0.12, 1.0, edge), 1.0, 0.0, 0.0, 0.0);
    s.height = relief * edge * (0.8 * bevel + 0.3 * (more.z - 0.5) - 0.1 * pores);
    s.height += relief * (0.04 * fibre - 0.05 * late);
    s.height += relief * edge * 0.25 * (within.y - 0.5) * (more.x - 0.5);
    s.roughness = clamp(mix(0.95, roughness + 0.12 * late + 0.12 * pores + 0.06 * fibre, edge), 0.05, 1.0);
    return s;
}
