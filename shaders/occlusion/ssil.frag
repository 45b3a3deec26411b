// Ambient occlusion and indirect light by a visibility bitmask (O. Therrien, Y. Levesque and G. Gilet, "Screen Space
// Indirect Lighting with Visibility Bitmask", 2023). Each slice of the hemisphere has 32 sectors of equal weight, and a
// surface occludes those between its front and its back. Light comes from the first surface in each sector.
#include "surfaces.glsl"
#include "directions.glsl"
#include "slice.glsl"
#include "strip.glsl"
#include "quad_mean.glsl"
uniform sampler2D surfaces;
uniform sampler2D diffuse;
uniform ivec2 screen_size;
uniform float radius;     // of occlusion, in metres
uniform float wider;      // radius of light, as a multiple of `radius`
uniform float thickness;  // metres
out vec4 unfiltered;

// The fraction (0 to 1) of a slice's integral up to an angle on a side, starting at the tangent plane of the side
// opposite to the direction.
float cumulative_fraction(Slice s, float cos_angle, float side) {
    float integral = side_integral(s, -1.0)
        + side * horizon_integral(s, max(cos_angle, cos_tangent_plane(s, side)), side);
    return clamp(integral / s.full_integral, 0.0, 1.0);
}

// The bits of the sectors between two fractions.
uint sector_mask(float begin, float end) {
    int first = int(round(begin * 32.0));
    int count = int(round(end * 32.0)) - first;
    return count < 32 ? bitfieldInsert(0u, 0xFFFFFFFFu, first, max(count, 0)) : 0xFFFFFFFFu;
}

// Irradiance over pi in xyz, ambient visibility in w.
vec4 gather(View view, ivec2 texel, vec2 uv, vec3 position, vec4 surface) {
    ivec2 size = textureSize(surfaces, 0);
    float light_radius = radius * wider;
    vec2 radius_uv = projected_length(view, light_radius, clip_w(view, surface.w));
    vec3 view_dir = view_space_view_dir(view, position);
    vec2 direction = first_direction(DIRECTIONS);
    vec3 light = vec3(0.0);
    float occlusion = 0.0;
    float total_weight = 0.0;
    for (int slice_index = 0; slice_index < DIRECTIONS / 2; ++slice_index) {
        Slice s = make_slice(direction, view_dir, surface.xyz);
        float sector_weight = s.projected_length * s.full_integral / 32.0;
        float jitter = step_jitter(slice_index);
        ViewRays rays = view_rays(view, uv, radius_uv * direction);
        uint covered = 0u;   // by surfaces within the radius of light
        uint occluded = 0u;  // by surfaces within the radius of occlusion
        for (int i = 0; i < 2 * STEPS; ++i) {
            bool backwards = (i & 1) == 1;  // steps of both sides alternate, because near surfaces must come first
            float u = (float(i >> 1) + (backwards ? 1.0 - jitter : jitter)) / float(STEPS);
            vec2 side_direction = backwards ? -direction : direction;
            ivec2 sample_texel = ivec2(floor((uv + u * u * radius_uv * side_direction) * vec2(size)));
            if (sample_texel != clamp(sample_texel, ivec2(0), size - 1) || sample_texel == texel) continue;
            vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
            if (sample_surface.w == 0.0) continue;
            vec3 sample_position = view_position(
                view, texel_uv(sample_texel, size, screen_size), sample_surface.w);
            vec3 offset = sample_position - position;
            float sample_distance = length(offset);
            if (sample_distance > light_radius
                || !is_above_tangent_plane(view, offset, surface.xyz, max(surface.w, sample_surface.w))) continue;
            float inner = u - 0.5 / float(STEPS);
            float outer = u + 0.5 / float(STEPS);
            float side = backwards ? -1.0 : 1.0;
            vec2 ends = side * vec2(inner * abs(inner), outer * outer);
            vec2 cosines = strip_cosines(
                rays, ends.x, ends.y, position, offset, sample_surface.xyz, view_dir, thickness);
            float front = cumulative_fraction(s, cosines.y, side);
            float back = cumulative_fraction(s, cosines.x, side);
            uint mask = sector_mask(min(front, back), max(front, back));
            if (dot(sample_surface.xyz, offset) < 0.0) {
                vec3 radiance = fetch_texel(diffuse, screen_texel(sample_texel, size, screen_size), screen_size).rgb;
                light += sector_weight * float(bitCount(mask & ~covered)) * radiance;
            }
            covered |= mask;
            if (sample_distance <= radius) occluded |= mask;
        }
        occlusion += sector_weight * float(bitCount(occluded));
        total_weight += 32.0 * sector_weight;
        direction = next_direction(direction, DIRECTIONS);
    }
    return vec4(light / total_weight, 1.0 - occlusion / total_weight);
}

void main() {
    View view = surfaces_views[0];
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = current_surface_texel(size);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 uv = texel_uv(texel, size, screen_size);
    vec3 position = view_position(view, uv, surface.w);
    vec4 value = surface.w == 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : gather(view, texel, uv, position, surface);
    unfiltered = quad_mean(value, surface, position, 0.1 * radius + depth_error(view, surface.w));
}
