// Horizon-based ambient occlusion (L. Bavoil and M. Sainz, "Image-Space Horizon-Based Ambient Occlusion", 2008):
// follows the horizon along each direction, and attenuates each increase of its elevation by distance.
#include "surfaces.glsl"
#ifdef SPARSE
#define DIRECTIONS max(SAMPLES / STEPS * 3 / 4, 2)  // fewer, because more than twice as many pixels are averaged
#endif
#include "directions.glsl"
#include "quad_mean.glsl"
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform float radius;       // metres
uniform float attenuation;  // at the radius, 0 to 1
out float unfiltered;

float compute_visibility(View view, vec2 uv, vec3 position, vec4 surface) {
    ivec2 size = textureSize(surfaces, 0);
    vec2 radius_uv = projected_length(view, radius, clip_w(view, surface.w));
    vec3 view_dir = view_space_view_dir(view, position);
    vec2 direction = first_direction(DIRECTIONS);
    float occlusion = 0.0;
    float radius_squared = radius * radius;
    float falloff = attenuation / radius_squared;
    for (int i = 0; i < DIRECTIONS; ++i) {
        float jitter = step_jitter(i);
        // Starts at the tangent plane. The sine of the elevation is the cosine of the angle to the view direction.
        vec3 slice_normal = normalize(cross(vec3(direction, 0.0), view_dir));
        vec3 tangent = cross(surface.xyz, slice_normal);
        float sin_horizon = dot(tangent, view_dir) * inversesqrt(max(dot(tangent, tangent), 1e-12));
        for (int j = 0; j < STEPS; ++j) {
            float fraction = (float(j) + jitter) / float(STEPS);
            ivec2 sample_texel = ivec2(floor((uv + fraction * radius_uv * direction) * vec2(size)));
            vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
            vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w) - position;
            float distance_squared = dot(offset, offset);
            float increase = dot(offset, view_dir) / length(offset) - sin_horizon;
            bool on_screen = sample_texel == clamp(sample_texel, ivec2(0), size - 1);
            bool in_radius = on_screen && sample_surface.w > 0.0 && distance_squared <= radius_squared;
            bool occludes = in_radius && increase > 0.0
                && is_above_tangent_plane(view, offset, surface.xyz, max(surface.w, sample_surface.w));
            increase = occludes ? increase : 0.0;
            occlusion += increase * (1.0 - falloff * distance_squared);
            sin_horizon += increase;
        }
        direction = next_direction(direction, DIRECTIONS);
    }
    return 1.0 - occlusion / float(DIRECTIONS);
}

void main() {
    View view = surfaces_views[0];
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = current_surface_texel(size);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 uv = texel_uv(texel, size, screen_size);
    vec3 position = view_position(view, uv, surface.w);
    float visibility = surface.w == 0.0 ? 1.0 : compute_visibility(view, uv, position, surface);
    unfiltered = quad_mean(vec4(visibility), surface, position, 0.1 * radius + depth_error(view, surface.w)).x;
}
