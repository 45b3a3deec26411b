// Ground-truth ambient occlusion (J. Jimenez et al., 2016): finds the two horizons of each slice through the viewer and
// the pixel, and integrates the light between them in closed form.
#include "surfaces.glsl"
#ifdef SPARSE
#define DIRECTIONS max(SAMPLES / STEPS / 4 * 2, 2)  // fewer, because more than twice as many pixels are averaged
#endif
#include "directions.glsl"
#include "slice.glsl"
#include "quad_mean.glsl"
#include "value.glsl"
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform float radius;   // metres
uniform float falloff;  // share of the radius over which occluders fade out
out Value unfiltered;

// The cosine of the horizon angle along a direction, at least `cos_lowest`.
float find_horizon(
    View view, vec2 uv, vec2 radius_uv, vec3 position, vec4 surface, float cos_lowest, float jitter
) {
    ivec2 size = textureSize(surfaces, 0);
    vec3 view_dir = view_space_view_dir(view, position);
    float cos_horizon = cos_lowest;
    for (int i = 0; i < STEPS; ++i) {
        float fraction = (float(i) + jitter) / float(STEPS);
        ivec2 sample_texel = ivec2(floor((uv + fraction * radius_uv) * vec2(size)));
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w) - position;
        float distance_squared = dot(offset, offset);
        bool on_screen = sample_texel == clamp(sample_texel, ivec2(0), size - 1);
        bool in_radius = on_screen && sample_surface.w > 0.0 && distance_squared <= radius * radius;
        bool occludes = in_radius
            && is_above_tangent_plane(view, offset, surface.xyz, max(surface.w, sample_surface.w));
        float cos_sample = dot(offset, view_dir) / length(offset);
        float near = clamp((radius - sqrt(distance_squared)) / max(falloff * radius, 1e-12), 0.0, 1.0);
        cos_horizon = occludes ? max(cos_horizon, mix(cos_lowest, cos_sample, near)) : cos_horizon;
    }
    return clamp(cos_horizon, -1.0, 1.0);
}

// The light of a side that lies below a horizon; 0 if nothing is above the tangent plane.
float occluded_integral(Slice s, float cos_horizon, float side) {
    return cos_horizon > cos_tangent_plane(s, side) ? side_integral(s, side) - horizon_integral(s, cos_horizon, side)
                                                    : 0.0;
}

// Ambient visibility in w and, with HAS_VECTOR, the mean unoccluded direction in xyz.
vec4 compute_visibility(View view, vec2 uv, vec3 position, vec4 surface) {
    vec2 radius_uv = projected_length(view, radius, clip_w(view, surface.w));
    vec3 view_dir = view_space_view_dir(view, position);
    vec2 direction = first_direction(DIRECTIONS);
    vec3 bent_normal = vec3(0.0);
    float occlusion = 0.0;
    float total_weight = 0.0;
    for (int i = 0; i < DIRECTIONS / 2; ++i) {
        Slice s = make_slice(direction, view_dir, surface.xyz);
        float jitter = step_jitter(i);
        float cos_h2 = find_horizon(
            view, uv, radius_uv * direction, position, surface, cos_tangent_plane(s, 1.0), jitter);
        float cos_h1 = find_horizon(
            view, uv, -radius_uv * direction, position, surface, cos_tangent_plane(s, -1.0), 1.0 - jitter);
        occlusion += s.projected_length * (occluded_integral(s, cos_h2, 1.0) + occluded_integral(s, cos_h1, -1.0));
#ifdef HAS_VECTOR
        bent_normal += s.projected_length * bent_direction(s, -acos(cos_h1), acos(cos_h2));
#endif
        total_weight += s.projected_length * s.full_integral;
        direction = next_direction(direction, DIRECTIONS);
    }
#ifdef SPARSE
    // The mean weight of all slices, because neighbours have other slices: dividing by the pixel's own weight would
    // count slices that contain little of the normal as much as others. At full size, where few neighbours may be on
    // the surface, the pixel's own weight is better.
    total_weight = float(DIRECTIONS / 2);
#endif
    return vec4(bent_normal / total_weight, 1.0 - occlusion / total_weight);
}

void main() {
    View view = surfaces_views[0];
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = current_surface_texel(size);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 uv = texel_uv(texel, size, screen_size);
    vec3 position = view_position(view, uv, surface.w);
    vec4 value = surface.w == 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : compute_visibility(view, uv, position, surface);
    value = quad_mean(value, surface, position, 0.1 * radius + depth_error(view, surface.w));
#ifdef HAS_VECTOR
    unfiltered = vec4(mat3(view.inverse_view) * value.xyz, value.w);
#else
    unfiltered = value.w;
#endif
}
