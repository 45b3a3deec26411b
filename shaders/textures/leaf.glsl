// One leaf with its ribs, its tip at the top of the tile; alpha is 0 around it. For `alpha_mode: mask`.
#include <texture_sample.glsl>
uniform vec3 color;
uniform vec3 rib_color;
uniform float width;
uniform float lobes;
uniform float relief;
uniform float roughness;

TextureSample texture_sample(vec2 uv) {
    float along = 1.0 - uv.y;               // 0 at the stalk, 1 at the tip
    float t = clamp((along - 0.06) / 0.92, 0.0, 1.0);
    float side = uv.x - 0.5 - 0.03 * sin(3.0 * along);
    float outline = width * 0.5 * pow(sin(3.14159 * pow(t, 0.72)), 0.85) * (1.0 - lobes * 0.3 * abs(sin(12.0 * t)));
    float blade = outline - abs(side);
    float stalk = (along < 0.25 ? 0.012 : 0.0) - abs(side);
    float alpha = along < 0.98 && max(blade, stalk) > 0.0 ? 1.0 : 0.0;
    // Side ribs branch off the midrib at an angle and bend upwards.
    float rib_at = (t - 0.9 * abs(side) / max(width, 0.1) + 1.2 * side * side) * 9.0 + 0.35 * step(0.0, side);
    float ribs = smoothstep(0.1, 0.02, abs(fract(rib_at) - 0.5) * (0.35 + 1.2 * t));
    float middle = smoothstep(0.016, 0.004, abs(side) * (0.6 + 0.9 * t));
    float rib = max(middle, 0.55 * ribs * smoothstep(0.0, 0.05, abs(side)));
    float cells = 0.6 - cellular_noise(uv, ivec2(48), 0.9, 10).nearest;
    float large = fractal_noise(uv, ivec2(5), 4, 0.5, 20);
    float rim = smoothstep(0.02, 0.0, blade);
    vec3 base = shaded(color, 0.35 * large + 0.12 * smoothstep(0.0, 0.4, cells) - 0.15);
    base = mix(base, rib_color, 0.7 * rib + 0.15 * rim);
    TextureSample s = TextureSample(base, alpha, 0.0, 0.0, 0.0);
    s.height = relief * (0.3 * smoothstep(0.0, 0.4, cells) - rib + 0.5 * cos(6.2832 * (fract(rib_at) - 0.5)) * 0.6);
    s.roughness = clamp(roughness + 0.1 * large + 0.1 * rib, 0.05, 1.0);
    return s;
}
