// Ambient occlusion from points in the hemisphere above each surface, projected back onto the picture of the scene.
// Each direction is looked along at four points: one within the narrow hemisphere, three within the wide one. Nothing
// here branches but the loops: rasterisers that run many pixels at once would run both sides, and more slowly.
#include "surfaces.glsl"
#include "quad.glsl"
#if ANIMATED
#include <frame.glsl>
#endif
uniform sampler2D surfaces;
uniform sampler2D noise;
uniform ivec2 screen;
uniform float radius;   // metres, of the wide hemisphere
uniform float nearest;  // metres
uniform int blur;       // texels; where there is one, four pixels share what they find
uniform vec3 directions[SAMPLES / 4];
out float unfiltered;

const float NARROW = 0.2;     // of the radius: 1 : 5
const float THRESHOLD = 4.0;  // in radii

// How far along a direction its point number `step` lies, as a share of it; `jitter` 0 to 1.
float reach(int step, float jitter) {
    if (step == 0) return NARROW * (0.4 + 0.6 * jitter);
    return NARROW + (1.0 - NARROW) * (float(step - 1) + jitter) / 3.0;
}

// A pixel, and what is the same along all directions from it. Places are in texels, times clip space's w, and w.
struct Start {
    vec3 position;
    vec4 surface;
    vec3 place;
    mat3 change;   // of the place, over one radius along each axis of view space
    vec4 to_edge;  // one over how far the picture's edges are away
};

Start start_at(View v, ivec2 texel, vec2 size) {
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 middle = place_for(texel, ivec2(size), screen);
    float w = clip_w(v, surface.w);
    vec3 place = vec3(middle * size, 1.0) * w;
    mat4 p = v.projection;
    mat3 change = 0.5 * radius * mat3(
        size.x * p[0][0], 0.0, 0.0, 0.0, size.y * p[1][1], 0.0, size * (p[2].xy + p[2][3]), 2.0 * p[2][3]);
    vec4 to_edges = 1.0 / vec4(size * w - place.xy, place.xy);
    return Start(view_position(v, middle, surface.w), surface, place, change, to_edges);
}

// How much of what lies along a direction is blocked, 0 to 1.
float blocked_along(View v, Start here, ivec2 size, vec3 along, float jitter) {
    vec3 way = here.change * along;
    vec4 leaving = vec4(way.xy - vec2(size) * way.z, -way.xy) * here.to_edge;
    // All points lie on the picture: a way that leaves it has them before.
    float whole = 0.9999 / max(max(max(leaving.x, leaving.y), max(leaving.z, leaving.w)), 0.9999);
    float most = 0.0;
    float doubtful = 0.0;  // by a face that looks away: how thick it is, the picture does not say
    float through = 0.0;   // one over where the way passes that face
    for (int step = 0; step < 4; ++step) {
        float t = whole * reach(step, jitter);
        vec3 place = here.place + t * way;
        ivec2 there = ivec2(place.xy / place.z);
        vec4 seen = look_up(surfaces, there, size);
        vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - here.position;
        float behind = -here.position.z - t * radius * along.z - seen.w;
        float outwards = dot(offset, seen.xyz);
        float crosses = dot(along, seen.xyz) * radius;
        bool hidden = behind > 0.0;
        hidden = hidden && seen.w > 0.0;
        bool away = outwards > 0.0;
        // Near enough itself, or a face that extended cuts the way to the point: what floats beyond does neither.
        bool cuts = t * crosses < outwards;
        cuts = cuts && !away;
        bool near = dot(offset, offset) <= radius * radius;
        bool counts = rises(v, offset, here.surface.xyz, max(here.surface.w, seen.w));
        counts = counts && (near || cuts);
        // Highest for small differences of depth, 0 beyond the threshold.
        float share = behind / (THRESHOLD * radius);
        float blocking = counts ? max(1.0 - share * share, 0.0) : 0.0;
        // In sight again: through the face, or beside it, having passed behind something thin.
        float passed = t * through > 1.0 ? doubtful : 0.0;
        float crossing = crosses / outwards;
        most = max(most, hidden ? (away ? 0.0 : blocking) : passed);
        doubtful = hidden ? max(doubtful, away ? blocking : 0.0) : 0.0;
        through = counts && away ? crossing : through;
    }
    return max(most, doubtful);
}

void main() {
    View v = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    Start here = start_at(v, texel_here(size), vec2(size));
#if ANIMATED
    vec4 random = texelFetch(noise, pixel + frame_index * ivec2(37, 19) & 63, 0);
#else
    vec4 random = texelFetch(noise, pixel & 63, 0);
#endif
    vec3 mirror = normalize(random.xyz);
    float blocked = 0.0;
    int count = here.surface.w > nearest ? SAMPLES / 4 : 0;
    for (int i = 0; i < count; ++i) {
        // A unit vector added to the normal: uniform on the sphere becomes cosine-weighted over the hemisphere.
        vec3 along = here.surface.xyz + reflect(directions[i], mirror);
        along *= inversesqrt(max(dot(along, along), 1e-12));
        float jitter = fract(random.w * 0.5 + 0.5 + float(i) * 0.618034);
        blocked += blocked_along(v, here, size, along, jitter);
    }
    unfiltered = 1.0 - blocked / float(SAMPLES / 4);
    float tolerance = 0.1 * radius + depth_error(v, here.surface.w);
    if (blur > 0) unfiltered = mean_of_quad(vec4(unfiltered), here.surface, here.position, tolerance).x;
}
