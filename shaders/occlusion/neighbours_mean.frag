// The mean of what the 4×4 pixels around have found, where they lie on the same surface.
#include "surfaces.glsl"
#include "finish.glsl"
uniform sampler2D unfiltered;
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 here = look_up(surfaces, texel, size);
    if (here.w == 0.0) {
        finish(NOTHING);
        return;
    }
    vec3 position = view_position(v, place_for(texel, size, screen), here.w);
    float tolerance = 0.1 * radius + depth_error(v, here.w);
    float total = 1e-3;  // of its own, should no other lie on its surface
    Value sum = total * look_up(unfiltered, texel, size).PARTS;
    for (int i = 0; i < 4; ++i) {
        ivec2 there = texel + 2 * ivec2(i & 1, i >> 1) - 1;
        if (there != clamp(there, ivec2(0), size - 1)) continue;
        vec4 seen = look_up(surfaces, there, size);
        if (seen.w == 0.0) continue;
        vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
        float weight = same_surface(offset, here.xyz, seen.xyz, tolerance);
        sum += weight * look_up(unfiltered, there, size).PARTS;
        total += weight;
    }
    finish(sum / total);
}
