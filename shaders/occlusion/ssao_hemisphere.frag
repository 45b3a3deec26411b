// Ambient occlusion from points in the hemisphere above each surface, projected back onto the picture of the scene.
// Each direction is looked along at four points: one within the narrow hemisphere, three within the wide one.
#include "surfaces.glsl"
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
    vec4 random = texelFetch(noise, texel & 63, 0);
    vec3 mirror = normalize(random.xyz);
    float blocked = 0.0;
    for (int i = 0; i < SAMPLES / 4; ++i) {
        // A unit vector added to the normal: uniform on the sphere becomes cosine-weighted over the hemisphere.
        vec3 along = here.xyz + reflect(directions[i].xyz, mirror);
        along *= inversesqrt(max(dot(along, along), 1e-12));
        float jitter = fract(random.w * 0.5 + 0.5 + float(i) * 0.618034);
        float most = 0.0;
        for (int step = 0; step < 4; ++step) {
            vec3 point = position + along * (radius * reach(step, jitter));
            vec2 place = window_place(v, point);
            if (clip_w(v, -point.z) <= 0.0 || place != clamp(place, 0.0, 0.999999)) continue;
            ivec2 there = ivec2(place * vec2(size));
            vec4 seen = texelFetch(surfaces, there, 0);
            if (seen.w == 0.0) continue;
            vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
            if (!rises(v, offset, here.xyz, max(here.w, seen.w))) continue;
            // Near enough itself, or a face that extended cuts the way to the point: what floats beyond does neither.
            bool cuts = dot(offset, seen.xyz) < 0.0 && dot(position + offset - point, seen.xyz) > 0.0;
            if (cuts || dot(offset, offset) <= radius * radius) most = max(most, blocking(-point.z - seen.w));
        }
        blocked += most;
    }
    unfiltered = 1.0 - blocked / float(SAMPLES / 4);
}
