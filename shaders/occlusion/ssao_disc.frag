// Ambient occlusion from samples on a spiral in the disc that the radius covers on the screen. The surface seen at each
// is a disc in space, as large as the part of the picture it stands for.
#include "surfaces.glsl"
#include <disc_to_disc.glsl>
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres
out float rough;

// What a disc at `offset` hides; nothing from beyond the radius or below the horizon.
float hiding(View v, vec3 offset, vec3 normal, float far_off, float area, float facing) {
    float apart = length(offset);
    if (apart > radius || !rises(v, offset, normal, far_off)) return 0.0;
    return disc_occlusion(apart, area, facing, dot(normal, offset) / apart);
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 here = texelFetch(surfaces, texel, 0);
    rough = 1.0;
    if (here.w == 0.0) return;
    vec2 middle = place_for(texel, size, screen);
    vec3 position = view_position(v, middle, here.w);
    float w = clip_w(v, here.w);
    vec2 reach = 0.5 * radius / w * vec2(v.projection[0][0], v.projection[1][1]);
    float blocked = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        float turn = float(i) * 2.39996323;  // the golden angle: no two arms in line
        float out_to = (float(i) + 0.5) / float(SAMPLES);
        vec2 place = middle + out_to * reach * vec2(cos(turn), sin(turn));
        ivec2 there = ivec2(floor(place * vec2(size)));
        if (there != clamp(there, ivec2(0), size - 1) || there == texel) continue;
        vec4 seen = texelFetch(surfaces, there, 0);
        if (seen.w == 0.0) continue;
        vec3 at = view_position(v, place_for(there, size, screen), seen.w);
        // The ring's share of the disc on the screen, at the distance of what is seen there.
        float scale = clip_w(v, seen.w) / w;
        float ring = 6.28318531 * out_to / float(SAMPLES) * radius * radius * scale * scale;
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
    rough = max(1.0 - blocked, 0.0);
}
