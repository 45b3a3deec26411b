// Ambient occlusion from samples on a spiral in the disc that the radius covers on the screen. The surface seen at each
// is a disc in space. Every pixel turns and stretches the spiral in its own way, and four share what they find.
#include "surfaces.glsl"
#include "neighbours.glsl"
#include <disc_to_disc.glsl>
#include <noise.glsl>
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres
out float unfiltered;

const vec2 GOLDEN = vec2(-0.73736888, 0.67549029);  // cosine and sine of the golden angle: no two arms in line

// A large disc hides less than its parts would. All are as large as if there were this many of them, so that how dark
// it is does not depend on how many samples are taken.
const float DISCS = 512.0;

// What a disc at `offset` hides; nothing from beyond the radius or below the horizon.
float hiding(View v, vec3 offset, vec3 normal, float far_off, float area, float facing) {
    float apart = length(offset);
    if (apart > radius || !rises(v, offset, normal, far_off)) return 0.0;
    return disc_occlusion(apart, area, facing, dot(normal, offset) / apart);
}

float blocked_at(View v, ivec2 texel, vec2 middle, vec3 position, vec4 here) {
    ivec2 size = textureSize(surfaces, 0);
    float w = clip_w(v, here.w);
    vec2 reach = 0.5 * radius / w * vec2(v.projection[0][0], v.projection[1][1]);
    float turn = 2.0 * PI * interleaved_gradient_noise(vec2(texel));
    vec2 along = vec2(cos(turn), sin(turn));
    float stretch = interleaved_gradient_noise(vec2(texel.yx + 7));
    float blocked = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        float out_to = (float(i) + stretch) / float(SAMPLES);
        vec2 place = middle + out_to * reach * along;
        along = mat2(GOLDEN.x, GOLDEN.y, -GOLDEN.y, GOLDEN.x) * along;
        ivec2 there = ivec2(floor(place * vec2(size)));
        if (there != clamp(there, ivec2(0), size - 1) || there == texel) continue;
        vec4 seen = texelFetch(surfaces, there, 0);
        if (seen.w == 0.0) continue;
        vec3 at = view_position(v, place_for(there, size, screen), seen.w);
        // The ring's share of the disc on the screen, at the distance of what is seen there.
        float scale = clip_w(v, seen.w) / w;
        float ring = 2.0 * PI * out_to / DISCS * radius * radius * scale * scale;
        vec3 sight = v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : at / seen.w;
        vec3 offset = at - position;
        float facing = -dot(seen.xyz, offset) / length(offset);
        float slant = max(abs(dot(seen.xyz, sight)), 0.05);
        float far_off = max(here.w, seen.w);
        float hidden = hiding(v, offset, here.xyz, far_off, ring / slant, abs(facing));
        if (facing < 0.0) {
            // The far side of something solid. Its near side is not seen: a disc that faces the receiver stands for it,
            // behind what is seen, where the line of sight comes nearest.
            sight = normalize(sight);
            offset += sight * clamp(-dot(offset, sight), 0.0, radius);
            hidden = max(hidden, hiding(v, offset, here.xyz, far_off, ring, 1.0));
        }
        blocked += hidden;
    }
    return blocked * DISCS / float(SAMPLES);
}

// The mean with the other pixel of a pair, which holds what this one does and `change`, along x or y of the window.
void share(inout float blocked, float change, vec4 here, vec4 there, vec3 offset, View v) {
    if (there.w == 0.0) return;
    float weight = same_surface(offset, here.xyz, there.xyz, 0.1 * radius + depth_error(v, here.w));
    blocked += change * weight / (1.0 + weight);
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 here = texelFetch(surfaces, texel, 0);
    vec2 middle = place_for(texel, textureSize(surfaces, 0), screen);
    vec3 position = view_position(v, middle, here.w);
    float blocked = here.w == 0.0 ? 0.0 : blocked_at(v, texel, middle, position, here);
    // Derivatives are differences within the four pixels that are computed together: what leads to the other one.
    vec2 to_other = vec2(1 - 2 * (texel & 1));
    share(blocked, to_other.x * dFdxFine(blocked), here, here + to_other.x * dFdxFine(here),
          to_other.x * dFdxFine(position), v);
    share(blocked, to_other.y * dFdyFine(blocked), here, here + to_other.y * dFdyFine(here),
          to_other.y * dFdyFine(position), v);
    unfiltered = blocked / MOST_KEPT;
}
