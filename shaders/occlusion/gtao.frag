// Ground-truth ambient occlusion (J. Jimenez et al., 2016): in each slice through the eye and the pixel the two
// horizons, and of the light between them the integral in closed form.
#include "surfaces.glsl"
#ifdef SPARSE
#define ARMS max(SAMPLES / STEPS / 4 * 2, 2)  // reduced pixels share with more than twice as many
#endif
#include "arms.glsl"
#include "slice.glsl"
#include "quad.glsl"
#include "value.glsl"
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres
out Value unfiltered;

// The highest that surfaces rise along an arm, or `lowest`, as a cosine to the eye.
float horizon_along(
    View v, vec2 middle, vec2 reach, vec3 position, vec4 here, float lowest, float stretch
) {
    ivec2 size = textureSize(surfaces, 0);
    vec3 eye = to_eye(v, position);
    float horizon = lowest;
    for (int i = 0; i < STEPS; ++i) {
        float out_to = (float(i) + stretch) / float(STEPS);
        ivec2 there = ivec2(floor((middle + out_to * reach) * vec2(size)));
        vec4 seen = look_up(surfaces, there, size);
        vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
        float square = dot(offset, offset);
        bool inside = there == clamp(there, ivec2(0), size - 1) && seen.w > 0.0 && square <= radius * radius;
        bool counts = inside && rises(v, offset, here.xyz, max(here.w, seen.w));
        float rise = dot(offset, eye) / length(offset);
        horizon = counts && rise > horizon ? rise : horizon;
    }
    return clamp(horizon, -1.0, 1.0);
}

// Light of a side that a horizon takes away: none where nothing rises above the tangent plane.
float below(Slice s, float horizon, float side) {
    return horizon > tangent_plane(s, side) ? whole_side(s, side) - arc(s, horizon, side) : 0.0;
}

// Openness in w; in xyz, with FOUR, the direction of what is open.
vec4 open_at(View v, vec2 middle, vec3 position, vec4 here) {
    vec2 reach = covered(v, radius, clip_w(v, here.w));
    vec3 eye = to_eye(v, position);
    vec2 along = first_arm(ARMS);
    vec3 open = vec3(0.0);
    float blocked = 0.0;
    float whole = 0.0;
    for (int number = 0; number < ARMS / 2; ++number) {
        Slice s = slice_along(along, eye, here.xyz);
        float stretch = stretch_of(number);
        float after = horizon_along(
            v, middle, reach * along, position, here, tangent_plane(s, 1.0), stretch);
        float before = horizon_along(
            v, middle, -reach * along, position, here, tangent_plane(s, -1.0), 1.0 - stretch);
        blocked += s.share * (below(s, after, 1.0) + below(s, before, -1.0));
#ifdef FOUR
        open += s.share * arc_direction(s, -acos(before), acos(after));
#endif
        whole += s.share * s.whole;
        along = turned(along, ARMS);
    }
#ifdef SPARSE
    // What all slices have in the mean, as the neighbours have others: a quotient of each pixel's own would count
    // slices alike that the normal has little of. Where few neighbours are on the surface, at full size, one's own is
    // better.
    whole = float(ARMS / 2);
#endif
    return vec4(open / whole, 1.0 - blocked / whole);
}

void main() {
    View v = surfaces_views[0];
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = texel_here(size);
    vec4 here = texelFetch(surfaces, texel, 0);
    vec2 middle = place_for(texel, size, screen);
    vec3 position = view_position(v, middle, here.w);
    vec4 found = here.w == 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : open_at(v, middle, position, here);
    found = mean_of_quad(found, here, position, 0.1 * radius + depth_error(v, here.w));
#ifdef FOUR
    unfiltered = vec4(mat3(v.inverse_view) * found.xyz, found.w);
#else
    unfiltered = found.w;
#endif
}
