// One axis of a mean over neighbours that lie on the same surface; others do not count (C. Tomasi and R. Manduchi,
// "Bilateral Filtering for Gray and Color Images", 1998, with the surface in place of the colour).
#include "surfaces.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform ivec2 axis;    // (1, 0) or (0, 1)
uniform int blur;      // texels to each side
uniform float radius;  // metres
out float blurred;

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 here = texelFetch(surfaces, texel, 0);
    blurred = 1.0;
    if (here.w == 0.0) return;
    vec3 position = view_position(v, place_for(texel, size, screen), here.w);
    float sum = 0.0;
    float total = 0.0;
    for (int i = -blur; i <= blur; ++i) {
        ivec2 there = texel + i * axis;
        if (there != clamp(there, ivec2(0), size - 1)) continue;
        vec4 seen = texelFetch(surfaces, there, 0);
        if (seen.w == 0.0) continue;
        vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
        float weight = same_surface(offset, here.xyz, seen.xyz, 0.1 * radius + depth_error(v, here.w));
        sum += weight * texelFetch(source, there, 0).r;
        total += weight;
    }
    blurred = sum / total;
}
