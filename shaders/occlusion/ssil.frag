// Occlusion and light by a visibility bitmask (O. Therrien, Y. Levesque and G. Gilet, "Screen Space Indirect Lighting
// with Visibility Bitmask", 2023): each slice of the hemisphere has 32 sectors of equal weight, and a surface fills
// those that lie between its front and its back. Light comes from the first to fill a sector.
#include "surfaces.glsl"
#include "arms.glsl"
#include "slice.glsl"
#include "strip.glsl"
#include "quad.glsl"
uniform sampler2D surfaces;
uniform sampler2D diffuse;
uniform ivec2 screen;
uniform float radius;     // metres; farther away nothing occludes
uniform float wider;      // light comes from this many times as far
uniform float thickness;  // metres
out vec4 unfiltered;

// The share of a slice's light from before a cosine on a side, 0 to 1: from the tangent plane opposite the arm on.
float share_before(Slice s, float rise, float side) {
    float before = whole_side(s, -1.0) + side * arc(s, max(rise, tangent_plane(s, side)), side);
    return clamp(before / s.whole, 0.0, 1.0);
}

// The sectors between two shares.
uint sectors(float from, float to) {
    int first = int(round(from * 32.0));
    int count = int(round(to * 32.0)) - first;
    return count < 32 ? bitfieldInsert(0u, 0xFFFFFFFFu, first, max(count, 0)) : 0xFFFFFFFFu;
}

// Irradiance over pi in xyz, openness in w.
vec4 gathered_at(View v, ivec2 texel, vec2 middle, vec3 position, vec4 here) {
    ivec2 size = textureSize(surfaces, 0);
    float region = radius * wider;
    vec2 reach = covered(v, region, clip_w(v, here.w));
    vec3 eye = to_eye(v, position);
    vec2 along = first_arm(ARMS);
    vec3 light = vec3(0.0);
    float blocked = 0.0;
    float whole = 0.0;
    for (int number = 0; number < ARMS / 2; ++number) {
        Slice s = slice_along(along, eye, here.xyz);
        float weight = s.share * s.whole / 32.0;
        float stretch = stretch_of(number);
        Sights sights = sights_along(v, middle, reach * along);
        uint filled = 0u;    // by all in the region
        uint occluded = 0u;  // by what is within the radius
        for (int i = 0; i < 2 * STEPS; ++i) {
            bool back = (i & 1) == 1;  // both arms outwards at once: what is near fills its sectors first
            float u = (float(i >> 1) + (back ? 1.0 - stretch : stretch)) / float(STEPS);
            vec2 way = back ? -along : along;
            ivec2 there = ivec2(floor((middle + u * u * reach * way) * vec2(size)));
            if (there != clamp(there, ivec2(0), size - 1) || there == texel) continue;
            vec4 seen = look_up(surfaces, there, size);
            if (seen.w == 0.0) continue;
            vec3 at = view_position(v, place_for(there, size, screen), seen.w);
            vec3 offset = at - position;
            float apart = length(offset);
            if (apart > region || !rises(v, offset, here.xyz, max(here.w, seen.w))) continue;
            // Each stands for the part of its surface half-way to the samples before and after it.
            float inner = u - 0.5 / float(STEPS);
            float outer = u + 0.5 / float(STEPS);
            float side = back ? -1.0 : 1.0;
            vec2 ends = side * vec2(inner * abs(inner), outer * outer);
            vec2 strip = strip_of(sights, ends.x, ends.y, position, offset, seen.xyz, eye, thickness);
            float front = share_before(s, strip.y, side);
            float rear = share_before(s, strip.x, side);
            uint fills = sectors(min(front, rear), max(front, rear));
            if (dot(seen.xyz, offset) < 0.0) {
                vec3 sent = look_up(diffuse, texel_for(there, size, screen), screen).rgb;
                light += weight * float(bitCount(fills & ~filled)) * sent;
            }
            filled |= fills;
            if (apart <= radius) occluded |= fills;
        }
        blocked += weight * float(bitCount(occluded));
        whole += 32.0 * weight;
        along = turned(along, ARMS);
    }
    return vec4(light / whole, 1.0 - blocked / whole);
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = texel_here(textureSize(surfaces, 0));
    vec4 here = texelFetch(surfaces, texel, 0);
    vec2 middle = place_for(texel, textureSize(surfaces, 0), screen);
    vec3 position = view_position(v, middle, here.w);
    vec4 found = here.w == 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : gathered_at(v, texel, middle, position, here);
    unfiltered = mean_of_quad(found, here, position, 0.1 * radius + depth_error(v, here.w));
}
