// One axis of a mean over neighbours that lie on the same surface; others do not count (C. Tomasi and R. Manduchi,
// "Bilateral Filtering for Gray and Color Images", 1998, with the surface in place of the colour). Two by two texels
// hold what they share already: every other one is enough, and both ends are weighted so that the middle is the texel.
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
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    ivec2 last = target_size(size) - 1;
    ivec2 texel = texel_here(size);
    vec4 here = texelFetch(surfaces, texel, 0);
    vec3 position = view_position(v, place_for(texel, size, screen), here.w);
    float tolerance = 0.1 * radius + depth_error(v, here.w);
    ivec2 odd = pixel & axis;
#ifdef SPARSE
    int wide = blur * 3 >> 2;  // each has looked at more points, and is about more of the picture
#else
    int wide = blur;
#endif
    int reach = wide >> 1 << 1;
    float aside = 0.5 - float(odd.x + odd.y);  // from the texel to the middle of its four
    float total = 1e-3;  // of its own, should no other lie on its surface
    float sum = total * texelFetch(source, pixel, 0).r;
    for (int i = -reach; i <= reach; i += 2) {
        ivec2 there = clamp(pixel + i * axis, ivec2(0), last);
        ivec2 at = surface_of(there, size);
        vec4 seen = look_up(surfaces, at, size);
        vec3 offset = view_position(v, place_for(at, size, screen), seen.w) - position;
        float within = clamp(0.5 * (float(wide) + 1.0 - abs(float(i) + aside)), 0.0, 1.0);
        float weight = within * same_surface(offset, here.xyz, seen.xyz, tolerance);
        sum += weight * look_up(source, there, last + 1).r;
        total += weight;
    }
    blurred = sum / total;
}
