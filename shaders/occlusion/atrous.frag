// One pass of a joint bilateral filter with holes: the mean of 3×3 texels that lie `stride` apart, where they are on
// the same surface (H. Dammertz et al., "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination
// Filtering", 2010). Passes of twice the stride each reach far with few texels.
#include "surfaces.glsl"
#include "finish.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform int stride;
uniform float tolerance;  // metres off a plane

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 here = texelFetch(surfaces, texel, 0);
    Value own = texelFetch(source, texel, 0).PARTS;
    if (here.w == 0.0) {
        finish(own);
        return;
    }
    vec3 position = view_position(v, place_for(texel, size, screen), here.w);
    float off = tolerance + depth_error(v, here.w);
    Value sum = 4.0 * own;
    float total = 4.0;
    for (int i = 0; i < 9; ++i) {
        if (i == 4) continue;
        ivec2 step = ivec2(i % 3, i / 3) - 1;
        ivec2 there = texel + stride * step;
        if (there != clamp(there, ivec2(0), size - 1)) continue;
        vec4 seen = look_up(surfaces, there, size);
        if (seen.w == 0.0) continue;
        vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
        float weight = (step.x * step.y == 0 ? 2.0 : 1.0) * same_surface(offset, here.xyz, seen.xyz, off);
        sum += weight * look_up(source, there, size).PARTS;
        total += weight;
    }
    sum /= total;
#ifdef KEEP_OPENNESS
    sum.w = own.w;
#endif
    finish(sum);
}
