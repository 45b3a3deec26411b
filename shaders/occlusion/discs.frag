// Samples surfaces in the disc that a radius covers on the screen, along directions from near to far. Each sample
// occludes (OCCLUSION), as a strip of a slice or with BUNNELL as a disc in space, and emits light (LIGHT) as a disc.
#include "surfaces.glsl"
#include "directions.glsl"
#if defined(OCCLUSION) && !defined(BUNNELL)
#define STRIPS
#include "slice.glsl"
#include "strip.glsl"
uniform float thickness;  // in radii
#endif
#include "quad_mean.glsl"
#include "value.glsl"
#include <disc_form_factor.glsl>
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform float radius;  // of occlusion, in metres
#ifdef BUNNELL
#include "bunnell.glsl"
#endif
#ifdef LIGHT
uniform sampler2D diffuse;
#ifdef BEYOND
#include "beyond_views.glsl"
#endif
uniform float wider;  // radius of light, as a multiple of `radius`
#else
const float wider = 1.0;
#endif
out Value unfiltered;

// Discs are always as large as if there were this many of them. Their size limits the light of single discs close to a
// surface, which would glow otherwise.
const float EMITTING_DISCS = 512.0;

#ifdef BACK
#include "back_faces.glsl"
#endif

// Irradiance over pi in xyz, ambient visibility in w.
vec4 gather(View view, ivec2 texel, vec2 uv, vec3 position, vec4 surface) {
    ivec2 size = textureSize(surfaces, 0);
    float w = clip_w(view, surface.w);
    float search_radius = radius * wider;
    vec2 radius_uv = projected_length(view, search_radius, w);
    vec2 direction = first_direction(DIRECTIONS);
    vec3 view_dir = view_space_view_dir(view, position);
    float occlusion = 0.0;
    float total_weight = 0.0;
    vec3 light = vec3(0.0);
    for (int direction_index = 0; direction_index < DIRECTIONS; ++direction_index) {
        float jitter = step_jitter(direction_index);
        float cos_horizon = -1.0;  // to the view direction; samples below the horizon are hidden
        float direction_occlusion = 0.0;
#ifdef STRIPS
        Slice s = make_slice(direction, view_dir, surface.xyz);
        float cos_covered = cos_tangent_plane(s, 1.0);  // the horizon of strips within the radius of occlusion
        ViewRays rays = view_rays(view, uv, radius_uv * direction);
        float strip_end = 0.0;  // of the last strip, as a fraction of the search radius
#endif
        for (int i = 0; i < STEPS; ++i) {
            float u = (float(i) + jitter) / float(STEPS);
            vec2 sample_uv = uv + u * u * radius_uv * direction;
            ivec2 sample_texel = ivec2(floor(sample_uv * vec2(size)));
            if (sample_texel == texel) continue;
#ifdef STRIPS
            float strip_begin = strip_end;
            float outer = u + 0.5 / float(STEPS);
            strip_end = outer * outer;
#endif
            bool on_screen = sample_texel == clamp(sample_texel, ivec2(0), size - 1);
            // The area of the ring of the screen that all samples of this step stand for together, at the distance of
            // the pixel; relative to the mean of all steps.
            float ring_area = 4.0 * PI * u * u * u * search_radius * search_radius;
            vec4 sample_surface;
            vec3 sample_position;
#ifdef BEYOND
            ivec3 beyond_texel;
            if (!on_screen && !find_beyond(view, sample_uv, sample_surface, sample_position, beyond_texel)) continue;
#else
            if (!on_screen) continue;
#endif
            if (on_screen) {
#if defined(LIGHT) && defined(BACK)
                light += back_face_light(view, sample_texel, position, surface, w, search_radius, ring_area);
#endif
                sample_surface = fetch_texel(surfaces, sample_texel, size);
                if (sample_surface.w == 0.0) continue;
                sample_position = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w);
            }
            vec3 offset = sample_position - position;
            vec3 ray = view.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : sample_position / sample_surface.w;
            float sample_distance = length(offset);
            float cos_sample = dot(view_dir, offset) / sample_distance;
            float cos_emitter = -dot(sample_surface.xyz, offset) / sample_distance;
            float max_distance = max(surface.w, sample_surface.w);
            float scale = clip_w(view, sample_surface.w) / w;
            float sample_area = ring_area * scale * scale;  // the same ring at the distance of the sample
            float cos_ray = max(abs(dot(sample_surface.xyz, ray)), 0.05);
            bool is_visible = cos_sample >= cos_horizon;
            if (sample_distance <= search_radius && dot(surface.xyz, offset) > 0.0) {
                cos_horizon = max(cos_horizon, cos_sample);
            }
#ifdef LIGHT
            if (is_visible && cos_emitter > 0.0 && sample_distance <= search_radius
                && is_above_tangent_plane(view, offset, surface.xyz, max_distance)) {
                vec3 radiance;
#ifdef BEYOND
                if (!on_screen) radiance = texelFetch(beyond_light, beyond_texel, 0).rgb;
                else
#endif
                radiance = fetch_texel(diffuse, screen_texel(sample_texel, size, screen_size), screen_size).rgb;
                float cos_receiver = dot(surface.xyz, offset) / sample_distance;
                float disc_area = sample_area / EMITTING_DISCS / cos_ray;
                light += radiance * disc_form_factor(sample_distance, disc_area, cos_emitter, cos_receiver);
            }
#endif
#ifdef BUNNELL
            direction_occlusion += sample_occlusion(
                view, is_visible, offset, surface.xyz, max_distance, sample_surface.xyz, ray, sample_area);
#endif
#ifdef STRIPS
            if (sample_distance > radius || !is_above_tangent_plane(view, offset, surface.xyz, max_distance)) continue;
            vec2 cosines = strip_cosines(rays, strip_begin, strip_end, position, offset, sample_surface.xyz, view_dir,
                                         thickness * radius);
            cosines = clamp(cosines, cos_covered, 1.0);
            direction_occlusion += horizon_integral(s, cosines.x, 1.0) - horizon_integral(s, cosines.y, 1.0);
            cos_covered = cosines.y;
#endif
        }
#ifdef BUNNELL
        occlusion += min(direction_occlusion, MAX_DIRECTION_OCCLUSION);
        total_weight += 1.0;
#endif
#ifdef STRIPS
        occlusion += s.projected_length * direction_occlusion;
        total_weight += s.projected_length * side_integral(s, 1.0);
#endif
        direction = next_direction(direction, DIRECTIONS);
    }
    float visibility = total_weight > 0.0 ? 1.0 - occlusion / total_weight : 1.0;
    return vec4(light * EMITTING_DISCS / float(DIRECTIONS * STEPS), visibility);
}

void main() {
    View view = surfaces_views[0];
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = current_surface_texel(size);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 uv = texel_uv(texel, size, screen_size);
    vec3 position = view_position(view, uv, surface.w);
    vec4 value = surface.w == 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : gather(view, texel, uv, position, surface);
    value = quad_mean(value, surface, position, 0.1 * radius + depth_error(view, surface.w));
#ifdef HAS_VECTOR
    unfiltered = value;
#else
    unfiltered = value.w;
#endif
}
