// Samples in the disc that the radius covers on the screen, along arms from near to far. The surface seen at each is a
// disc in space that hides some of the sky (OPEN) and sends light (LIGHT).
#include "surfaces.glsl"
#include "arms.glsl"
#include "quad.glsl"
#include "value.glsl"
#include <disc_to_disc.glsl>
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres
#ifdef LIGHT
uniform sampler2D diffuse;
#ifdef BACK
uniform sampler2D back_surfaces;
uniform sampler2D back_diffuse;
#endif
#ifdef BEYOND
#include "beyond.glsl"
#endif
uniform float wider;  // light comes from this many times as far
#else
const float wider = 1.0;
#endif
out Value unfiltered;

// A large disc hides less than its parts would. All are as large as if there were this many of them, so that how dark
// it is does not depend on how many samples are taken.
const float DISCS = 2048.0;

// Light from discs close by is limited by their size, or single ones would glow: these are larger.
const float SENDING_DISCS = 512.0;

// More than this no arm hides, though discs that stand close add up to more.
const float MOST = 2.0;

// What a disc at `offset` hides; nothing from beyond the radius or below the horizon.
float hiding(View v, vec3 offset, vec3 normal, float far_off, float area, float facing) {
    float apart = length(offset);
    if (apart > radius || !rises(v, offset, normal, far_off)) return 0.0;
    return disc_occlusion(apart, area, facing, dot(normal, offset) / apart);
}

#ifdef BACK
// Light of the far side of what is seen, where the picture of back faces has one: an offset, and its share of the disc.
vec3 light_from_behind(View v, ivec2 there, vec3 position, vec4 here, float w, float region, float share) {
    ivec2 size = textureSize(back_surfaces, 0);
    vec4 seen = texelFetch(back_surfaces, there, 0);
    if (seen.w == 0.0) return vec3(0.0);
    vec3 at = view_position(v, place_for(there, size, screen), seen.w);
    vec3 offset = at - position;
    vec3 sight = v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : at / seen.w;
    float apart = length(offset);
    float facing = -dot(seen.xyz, offset) / apart;
    if (facing <= 0.0 || apart > region || !rises(v, offset, here.xyz, max(here.w, seen.w))) return vec3(0.0);
    float scale = clip_w(v, seen.w) / w;
    float area = share * scale * scale / max(abs(dot(seen.xyz, sight)), 0.05);
    vec3 sent = texelFetch(back_diffuse, texel_for(there, size, screen), 0).rgb;
    return sent * disc_transfer(apart, area / SENDING_DISCS, facing, dot(here.xyz, offset) / apart);
}
#endif

// Light in xyz, irradiance over pi, and openness in w.
vec4 gathered_at(View v, ivec2 texel, vec2 middle, vec3 position, vec4 here) {
    ivec2 size = textureSize(surfaces, 0);
    float w = clip_w(v, here.w);
    float region = radius * wider;
    vec2 reach = covered(v, region, w);
    vec2 along = first_arm(texel, ARMS);
    vec3 eye = to_eye(v, position);
    float blocked = 0.0;
    vec3 light = vec3(0.0);
    for (int arm = 0; arm < ARMS; ++arm) {
        float stretch = stretch_of(texel, arm);
        float horizon = -1.0;  // cosine of the angle to the eye; what lies below is hidden already
        float hidden = 0.0;
        for (int i = 0; i < STEPS; ++i) {
            float u = (float(i) + stretch) / float(STEPS);
            vec2 place = middle + u * u * reach * along;
            ivec2 there = ivec2(floor(place * vec2(size)));
            if (there == texel) continue;
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
                seen = texelFetch(surfaces, there, 0);
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
                sent = texelFetch(diffuse, texel_for(there, size, screen), 0).rgb;
                float towards = dot(here.xyz, offset) / apart;
                light += sent * disc_transfer(apart, ring / SENDING_DISCS / slant, facing, towards);
            }
#endif
#ifdef OPEN
            float hides = 0.0;
            if (in_sight) hides = hiding(v, offset, here.xyz, far_off, ring / DISCS / slant, abs(facing));
            if (facing < 0.0) {
                // The far side of something solid. Its near side is not seen: a disc that faces the receiver stands for
                // it, behind what is seen, where the line of sight comes nearest.
                sight = normalize(sight);
                offset += sight * clamp(-dot(offset, sight), 0.0, radius);
                hides = max(hides, hiding(v, offset, here.xyz, far_off, ring / DISCS, 1.0));
            }
            hidden += hides;
#endif
        }
        blocked += min(hidden * DISCS / float(STEPS), MOST);
        along = turned(along, ARMS);
    }
    return vec4(light * SENDING_DISCS / float(ARMS * STEPS), 1.0 - blocked / float(ARMS));
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
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
