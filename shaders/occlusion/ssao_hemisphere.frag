// Ambient occlusion from points in the hemisphere above each surface, projected back onto the picture of the scene.
// Each direction is looked along at four points: one within the narrow hemisphere, three within the wide one.
#include "surfaces.glsl"
#if ANIMATED
#include <frame.glsl>
#endif
uniform sampler2D surfaces;
uniform sampler2D noise;
uniform ivec2 screen;
uniform float radius;   // metres, of the wide hemisphere
uniform float nearest;  // metres
layout(std430) readonly buffer kernel { vec4 directions[]; };
out float unfiltered;

const float NARROW = 0.2;    // of the radius: 1 : 5
const float THRESHOLD = 4.0;  // in radii

// Highest for small differences of depth, 0 for negative ones and beyond the threshold.
float blocking(float behind) {
    float share = behind / (THRESHOLD * radius);
    return behind > 0.0 ? max(1.0 - share * share, 0.0) : 0.0;
}

// How far along a direction its point number `step` lies, in radii; `jitter` 0 to 1.
float reach(int step, float jitter) {
    if (step == 0) return NARROW * (0.4 + 0.6 * jitter);
    return NARROW + (1.0 - NARROW) * (float(step - 1) + jitter) / 3.0;
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 here = texelFetch(surfaces, texel, 0);
    unfiltered = 1.0;
    if (here.w <= nearest) return;
    vec3 position = view_position(v, place_for(texel, size, screen), here.w);
#if ANIMATED
    vec4 random = texelFetch(noise, texel + frame_index * ivec2(37, 19) & 63, 0);
#else
    vec4 random = texelFetch(noise, texel & 63, 0);
#endif
    vec3 mirror = normalize(random.xyz);
    float blocked = 0.0;
    for (int i = 0; i < SAMPLES / 4; ++i) {
        // A unit vector added to the normal: uniform on the sphere becomes cosine-weighted over the hemisphere.
        vec3 along = here.xyz + reflect(directions[i].xyz, mirror);
        along *= inversesqrt(max(dot(along, along), 1e-12));
        float jitter = fract(random.w * 0.5 + 0.5 + float(i) * 0.618034);
        float most = 0.0;
        float doubtful = 0.0;  // by a face that looks away: how thick it is, the picture does not say
        vec4 face = vec4(0.0);
        for (int step = 0; step < 4; ++step) {
            vec3 point = position + along * (radius * reach(step, jitter));
            vec2 place = window_place(v, point);
            if (clip_w(v, -point.z) <= 0.0 || place != clamp(place, 0.0, 0.999999)) continue;
            ivec2 there = ivec2(place * vec2(size));
            vec4 seen = texelFetch(surfaces, there, 0);
            float behind = -point.z - seen.w;
            if (seen.w == 0.0 || behind <= 0.0) {
                // In sight again: through the face, or beside it, having passed behind something thin.
                if (dot(point, face.xyz) > face.w) most = max(most, doubtful);
                doubtful = 0.0;
                continue;
            }
            vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
            if (!rises(v, offset, here.xyz, max(here.w, seen.w))) continue;
            // Near enough itself, or a face that extended cuts the way to the point: what floats beyond does neither.
            bool away = dot(offset, seen.xyz) > 0.0;
            bool cuts = !away && dot(position + offset - point, seen.xyz) > 0.0;
            if (!cuts && dot(offset, offset) > radius * radius) continue;
            if (away) {
                doubtful = max(doubtful, blocking(behind));
                face = vec4(seen.xyz, dot(seen.xyz, position + offset));
            } else {
                most = max(most, blocking(behind));
            }
        }
        blocked += max(most, doubtful);
    }
    unfiltered = 1.0 - blocked / float(SAMPLES / 4);
}
