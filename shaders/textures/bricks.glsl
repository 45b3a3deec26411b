// A wall of bricks or of hewn stone, in courses with mortar between them.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 mortar_color;
uniform int columns;
uniform int rows;
uniform float bond;
uniform float mortar;
uniform float variation;
uniform float relief;
uniform float wear;
uniform float roughness;

TextureSample texture_sample(vec2 uv) {
    float course = floor(uv.y * float(rows));
    // Every second course is shifted. If their number is odd, the last course lies between two unshifted ones, and is
    // shifted by half as much.
    float shift = mod(course, 2.0) + 0.5 * float(rows > 1 && rows % 2 == 1 && int(course) == rows - 1);
    vec2 p = vec2(uv.x * float(columns) + bond * shift, uv.y * float(rows));
    vec2 unit = vec2(1.0 / float(columns), 1.0 / float(rows));  // of a brick with its mortar, in parts of the tile
    ivec2 brick = ivec2(mod(floor(p.x), float(columns)), course);
    vec3 random = random3(brick, 1), more = random3(brick, 2);
    float rough = fractal_noise(uv, ivec2(32), 5, 0.65, 10);
    float large = fractal_noise(uv, ivec2(4), 4, 0.5, 20);
    // Distance to the brick's outline in parts of the tile; wear moves the outline, and each brick lies a little askew.
    vec2 within = fract(p) - 0.5;
    within += wear * 0.06 * (random.xy - 0.5);
    vec2 half_size = 0.5 * unit - 0.5 * mortar;
    float corner = wear * 0.25 * half_size.y;
    vec2 q = abs(within * unit) - half_size + corner;
    float outline = length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - corner;
    outline += wear * 0.5 * mortar * fractal_noise(uv, ivec2(24), 4, 0.6, 30);
    float edge = smoothstep(-0.5 * mortar, 0.35 * mortar, -outline);
    float rim = smoothstep(0.0, 1.6 * mortar, -outline);
    // Pits of the surface.
    CellularNoise pits = cellular_noise(uv, ivec2(90), 1.0, 40);
    float pit = smoothstep(0.3, 0.1, pits.nearest) * step(0.72, random3(pits.id, 41).x) * wear;
    float height = relief * (edge * (0.75 + 0.25 * rim) + 0.25 * (random.z - 0.5) * edge);
    height += relief * (0.12 * rough * (0.4 + 0.6 * edge) - 0.22 * pit * edge + 0.05 * large);
    height += relief * edge * 0.35 * dot(within, more.xy - 0.5);
    vec3 tint = mix(vec3(1.0), vec3(1.14, 0.95, 0.86), 2.0 * (more.z - 0.5) * variation);
    float lightness = variation * (1.3 * (random.z - 0.5) + 0.35 * large + 0.4 * rough);
    lightness -= 0.5 * pit + 0.25 * (1.0 - rim);
    // Some bricks are burnt darker than others.
    lightness -= 0.9 * variation * smoothstep(0.86, 0.95, more.x);
    vec3 fired = shaded(color * tint, lightness);
    float deep = 1.0 - smoothstep(0.0, mortar, outline + mortar);
    vec3 sand = shaded(mortar_color, 0.35 * rough + 0.25 * large - 0.35 * deep);
    TextureSample s = TextureSample(mix(sand, fired, edge), 1.0, height, 0.0, 0.0);
    s.roughness = clamp(mix(0.95, roughness + 0.12 * rough + 0.1 * pit, edge), 0.05, 1.0);
    return s;
}
