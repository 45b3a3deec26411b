// Horizon-based ambient occlusion (L. Bavoil and M. Sainz, "Image-Space Horizon-Based Ambient Occlusion", 2008): along
// each arm the highest elevation seen so far, and of each rise what its distance leaves.
#include "surfaces.glsl"
#ifdef SPARSE
#define ARMS max(SAMPLES / STEPS * 3 / 4, 2)  // reduced pixels share with more than twice as many
#endif
#include "arms.glsl"
#include "quad.glsl"
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;       // metres
uniform float attenuation;  // 0 to 1
out float unfiltered;

float open_at(View v, vec2 middle, vec3 position, vec4 here) {
    ivec2 size = textureSize(surfaces, 0);
    vec2 reach = covered(v, radius, clip_w(v, here.w));
    vec3 eye = to_eye(v, position);
    vec2 along = first_arm(ARMS);
    float blocked = 0.0;
    float region = radius * radius;
    float fade = attenuation / region;
    for (int arm = 0; arm < ARMS; ++arm) {
        float stretch = stretch_of(arm);
        // The tangent plane's line in the arm's slice, by its cosine to the eye: the sine of its elevation.
        vec3 across = normalize(cross(vec3(along, 0.0), eye));
        vec3 tangent = cross(here.xyz, across);
        float horizon = dot(tangent, eye) * inversesqrt(max(dot(tangent, tangent), 1e-12));
        for (int i = 0; i < STEPS; ++i) {
            float out_to = (float(i) + stretch) / float(STEPS);
            ivec2 there = ivec2(floor((middle + out_to * reach * along) * vec2(size)));
            vec4 seen = look_up(surfaces, there, size);
            vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
            float square = dot(offset, offset);
            float rise = dot(offset, eye) / length(offset) - horizon;
            bool inside = there == clamp(there, ivec2(0), size - 1) && seen.w > 0.0 && square <= region;
            bool counts = inside && rise > 0.0 && rises(v, offset, here.xyz, max(here.w, seen.w));
            rise = counts ? rise : 0.0;
            blocked += rise * (1.0 - fade * square);
            horizon += rise;
        }
        along = turned(along, ARMS);
    }
    return 1.0 - blocked / float(ARMS);
}

void main() {
    View v = surfaces_views[0];
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = texel_here(size);
    vec4 here = texelFetch(surfaces, texel, 0);
    vec2 middle = place_for(texel, size, screen);
    vec3 position = view_position(v, middle, here.w);
    float open = here.w == 0.0 ? 1.0 : open_at(v, middle, position, here);
    unfiltered = mean_of_quad(vec4(open), here, position, 0.1 * radius + depth_error(v, here.w)).x;
}
