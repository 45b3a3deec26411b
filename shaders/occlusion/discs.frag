// Samples in the disc that the radius covers on the screen, along arms from near to far. The surface seen at each hides
// some of the sky (OPEN), as a strip of the arm's slice or with BUNNELL as a disc in space, and sends light (LIGHT) as
// a disc.
#include "surfaces.glsl"
#include "arms.glsl"
#if defined(OPEN) && !defined(BUNNELL)
#define STRIPS
#include "slice.glsl"
#include "strip.glsl"
uniform float thickness;  // in radii
#endif
#include "quad.glsl"
#include "value.glsl"
#include <disc_form_factor.glsl>
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres
#ifdef BUNNELL
#include "discs_hide.glsl"
#endif
#ifdef LIGHT
uniform sampler2D diffuse;
#ifdef BEYOND
#include "beyond.glsl"
#endif
uniform float wider;  // light comes from this many times as far
#else
const float wider = 1.0;
#endif
out Value unfiltered;

// Light from discs close by is limited by their size, or single ones would glow: these are larger.
const float SENDING_DISCS = 512.0;

#ifdef BACK
#include "behind.glsl"
#endif

// Light in xyz, irradiance over pi, and openness in w.
vec4 gathered_at(View v, ivec2 texel, vec2 middle, vec3 position, vec4 here) {
    ivec2 size = textureSize(surfaces, 0);
    float w = clip_w(v, here.w);
    float region = radius * wider;
    vec2 reach = covered(v, region, w);
    vec2 along = first_arm(ARMS);
    vec3 eye = to_eye(v, position);
    float blocked = 0.0;
    float whole = 0.0;  // what could be, of all arms
    vec3 light = vec3(0.0);
    for (int arm = 0; arm < ARMS; ++arm) {
        float stretch = stretch_of(arm);
        float horizon = -1.0;  // cosine of the angle to the eye; what lies below is hidden already
        float hidden = 0.0;
#ifdef STRIPS
        Slice s = slice_along(along, eye, here.xyz);
        float skyline = tangent_plane(s, 1.0);  // the same of what lies within the radius, with its rims
        Sights sights = sights_along(v, middle, reach * along);
        float looked = 0.0;  // how far out, as a share of the region
#endif
        for (int i = 0; i < STEPS; ++i) {
            float u = (float(i) + stretch) / float(STEPS);
            vec2 place = middle + u * u * reach * along;
            ivec2 there = ivec2(floor(place * vec2(size)));
            if (there == texel) continue;
#ifdef STRIPS
            float from = looked;
            float outer = u + 0.5 / float(STEPS);
            looked = outer * outer;
#endif
            bool inside = there == clamp(there, ivec2(0), size - 1);
            float share = 4.0 * PI * u * u * u * region * region;
            vec4 seen;
            vec3 at;
#ifdef BEYOND
            ivec3 aside;
            if (!inside && !seen_beyond(v, place, seen, at, aside)) continue;
#else
            if (!inside) continue;
#endif
            if (inside) {
#if defined(LIGHT) && defined(BACK)
                light += light_from_behind(v, there, position, here, w, region, share);
#endif
                seen = look_up(surfaces, there, size);
                if (seen.w == 0.0) continue;
                at = view_position(v, place_for(there, size, screen), seen.w);
            }
            vec3 offset = at - position;
            vec3 sight = v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : at / seen.w;
            float apart = length(offset);
            float rise = dot(eye, offset) / apart;
            float facing = -dot(seen.xyz, offset) / apart;
            float far_off = max(here.w, seen.w);
            // The ring's share of the disc on the screen, at the distance of what is seen there; rings grow outwards.
            float scale = clip_w(v, seen.w) / w;
            float ring = share * scale * scale;
            float slant = max(abs(dot(seen.xyz, sight)), 0.05);
            bool in_sight = rise >= horizon;
            if (apart <= region && dot(here.xyz, offset) > 0.0) horizon = max(horizon, rise);
#ifdef LIGHT
            if (in_sight && facing > 0.0 && apart <= region && rises(v, offset, here.xyz, far_off)) {
                vec3 sent;
#ifdef BEYOND
                if (!inside) sent = texelFetch(beyond_light, aside, 0).rgb;
                else
#endif
                sent = look_up(diffuse, texel_for(there, size, screen), screen).rgb;
                float towards = dot(here.xyz, offset) / apart;
                light += sent * disc_form_factor(apart, ring / SENDING_DISCS / slant, facing, towards);
            }
#endif
#ifdef BUNNELL
            hidden += hidden_by(v, in_sight, offset, here.xyz, far_off, seen.xyz, sight, ring);
#endif
#ifdef STRIPS
            if (apart > radius || !rises(v, offset, here.xyz, far_off)) continue;
            vec2 strip = strip_of(sights, from, looked, position, offset, seen.xyz, eye, thickness * radius);
            strip = clamp(strip, skyline, 1.0);
            hidden += arc(s, strip.x, 1.0) - arc(s, strip.y, 1.0);
            skyline = strip.y;
#endif
        }
#ifdef BUNNELL
        blocked += min(hidden, MOST);
        whole += 1.0;
#endif
#ifdef STRIPS
        blocked += s.share * hidden;
        whole += s.share * whole_side(s, 1.0);
#endif
        along = turned(along, ARMS);
    }
    return vec4(light * SENDING_DISCS / float(ARMS * STEPS), whole > 0.0 ? 1.0 - blocked / whole : 1.0);
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = texel_here(textureSize(surfaces, 0));
    vec4 here = texelFetch(surfaces, texel, 0);
    vec2 middle = place_for(texel, textureSize(surfaces, 0), screen);
    vec3 position = view_position(v, middle, here.w);
    vec4 found = here.w == 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : gathered_at(v, texel, middle, position, here);
    found = mean_of_quad(found, here, position, 0.1 * radius + depth_error(v, here.w));
#ifdef FOUR
    unfiltered = found;
#else
    unfiltered = found.w;
#endif
}
