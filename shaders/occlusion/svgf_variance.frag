// The variance of each pixel's mean: from its own moments, or in the first frames also from those of its neighbours on
// the same surface.
#include "surfaces.glsl"
uniform sampler2D mean;
uniform sampler2D moments;
uniform sampler2D counts;    // length of xyz: frames in the mean
uniform sampler2D surfaces;  // view space
uniform ivec2 screen_size;
uniform float tolerance;
out vec4 filtered;  // light over albedo; alpha is the variance of its luminance
#ifdef WRITES_VARIANCE
out float variance;
#endif

const float OWN_FRAMES = 8.0;  // from this many frames on, a pixel's own moments suffice

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 surface = texelFetch(surfaces, texel, 0);
    float count = length(texelFetch(counts, texel, 0).xyz);
    filtered = vec4(min(texelFetch(mean, texel, 0).rgb, 65504.0), 0.0);
    if (surface.w > 0.0 && count >= 0.5) {
        vec2 sums = texelFetch(moments, texel, 0).rg;
        float samples = count;
        if (count < OWN_FRAMES) {
            View view = surfaces_views[0];
            ivec2 size = textureSize(surfaces, 0);
            vec3 position = view_position(view, texel_uv(texel, size, screen_size), surface.w);
            float plane_tolerance = tolerance * surface.w + depth_error(view, surface.w), total = 1.0;
            for (int i = 0; i < 49; ++i) {
                ivec2 other = texel + ivec2(i % 7, i / 7) - 3;
                if (i == 24 || other != clamp(other, ivec2(0), size - 1)) continue;
                vec4 other_surface = fetch_texel(surfaces, other, size);
                if (other_surface.w == 0.0) continue;
                vec3 offset = view_position(view, texel_uv(other, size, screen_size), other_surface.w) - position;
                float weight = bilateral_weight(offset, surface.xyz, other_surface.xyz, plane_tolerance);
                sums += weight * fetch_texel(moments, other, size).rg;
                samples += weight * length(fetch_texel(counts, other, size).xyz);
                total += weight;
            }
            sums /= total;
        }
        float unbiased = samples / max(samples - 1.0, 0.5);
        filtered.a = min(max(sums.y - sums.x * sums.x, 0.0) * unbiased / count, 65504.0);
    }
#ifdef WRITES_VARIANCE
    variance = filtered.a;
#endif
}
