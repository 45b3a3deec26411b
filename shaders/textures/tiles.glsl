// Glazed or stone tiles with grout, in one colour or as a chequerboard of two.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 second_color;
uniform vec3 grout_color;
uniform int columns;
uniform int rows;
uniform float grout;
uniform float variation;
uniform float relief;
uniform float tilt;
uniform float roughness;

TextureSample texture_sample(vec2 uv) {
    vec2 p = uv * vec2(columns, rows);
    ivec2 tile = ivec2(floor(p));
    vec3 random = random3(tile, 1), more = random3(tile, 2);
    vec2 within = fract(p) - 0.5;
    vec2 unit = 1.0 / vec2(columns, rows);
    vec2 half_size = 0.5 * unit - 0.5 * grout;
    float corner = 0.8 * grout;
    vec2 q = abs(within * unit) - half_size + corner;
    float chip = fractal_noise(uv, ivec2(40), 3, 0.6, 10);
    float outline = length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - corner + 0.12 * grout * chip;
    float edge = smoothstep(-0.12 * grout, 0.3 * grout, -outline);
    float cushion = smoothstep(0.0, 3.0 * grout, -outline);
    float large = fractal_noise(uv + random.xy, ivec2(5), 5, 0.55, 20);
    float fine = fractal_noise(uv, ivec2(64), 3, 0.6, 30);
    bool is_second = ((tile.x + tile.y) & 1) == 1;
    // A thin line where a vein crosses, and speckles, as in fired clay and in stone.
    float vein = smoothstep(0.035, 0.0, abs(fractal_noise(uv + more.xy, ivec2(3), 4, 0.5, 40)));
    vec3 body = shaded(is_second ? second_color : color, variation * (random.z - 0.5 + 0.75 * large + 0.2 * fine));
    body = mix(body, shaded(body, 0.45), 0.35 * vein * variation);
    float dirt = smoothstep(0.1, 0.7, fractal_noise(uv, ivec2(6), 4, 0.55, 50));
    vec3 sand = shaded(grout_color, 0.5 * fine - 0.3 * dirt);
    TextureSample s = TextureSample(mix(sand, body, edge), 1.0, 0.0, 0.0, 0.0);
    s.height = relief * (edge * (0.6 + 0.4 * cushion) + 0.1 * fine * (1.0 - edge) + 0.02 * large * edge);
    s.height += edge * tilt * dot(within * unit, more.xy - 0.5);
    s.roughness = mix(0.92, clamp(roughness + 0.1 * large + 0.18 * dirt * variation, 0.05, 1.0), edge);
    return s;
}
