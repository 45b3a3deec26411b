// Ambient occlusion from samples on a spiral in the disc that the radius covers on the screen. The surface seen at each
// is a disc in space, as large as the part of the picture it stands for.
#include "surfaces.glsl"
#include <disc_to_disc.glsl>
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres
out float rough;

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
        vec3 offset = at - position;
        float apart = length(offset);
        if (apart > radius || !rises(v, offset, here.xyz, max(here.w, seen.w))) continue;
        vec3 towards = offset / apart;
        // The ring's share of the disc, at the sample's distance, seen aslant.
        float scale = clip_w(v, seen.w) / w;
        vec3 sight = v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : at / seen.w;
        float ring = 6.28318531 * out_to / float(SAMPLES) * radius * radius;
        float area = ring * scale * scale / max(abs(dot(seen.xyz, sight)), 0.05);
        // A face turned away is the far side of something solid, and hides as much as its hidden near side.
        blocked += disc_occlusion(apart, area, abs(dot(seen.xyz, towards)), dot(here.xyz, towards));
    }
    rough = max(1.0 - blocked, 0.0);
}
