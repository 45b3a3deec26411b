// One pass of the variance-guided à-trous filter: 5×5 texels that are `stride` apart, weighted by a B-spline, by plane
// and normal, and by the difference of luminance over its standard deviation (Schied et al. 2017). The distance from
// the tangent plane replaces the depth gradient of the original.
#include "surfaces.glsl"
#include "svgf_albedo.glsl"
#include <luminance.glsl>
uniform sampler2D source;    // light over albedo; alpha is the variance of its luminance
uniform sampler2D surfaces;  // view space
uniform ivec2 screen_size;
uniform int stride;
uniform float tolerance;
uniform float luminance_tolerance;
#ifdef FINAL
uniform sampler2D albedo;
uniform sampler2D radiance;
out vec4 denoised;
#else
out vec4 filtered;
#endif

const float KERNEL[3] = float[](0.375, 0.25, 0.0625);

// Variance around a texel, by a Gaussian of 3×3 texels: the variance of one texel is itself noisy.
float smooth_variance(ivec2 texel, ivec2 size) {
    float sum = 0.0;
    for (int i = 0; i < 9; ++i) {
        ivec2 step = ivec2(i % 3, i / 3) - 1;
        float weight = (step.x == 0 ? 0.5 : 0.25) * (step.y == 0 ? 0.5 : 0.25);
        sum += weight * fetch_texel(source, clamp(texel + step, ivec2(0), size - 1), size).a;
    }
    return sum;
}

void main() {
    View view = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec4 center = texelFetch(source, texel, 0);
    if (surface.w > 0.0) {
        vec3 position = view_position(view, texel_uv(texel, size, screen_size), surface.w);
        float plane_tolerance = tolerance * surface.w + depth_error(view, surface.w);
        float luminance = luminance_of(center.rgb);
        float deviation = luminance_tolerance * sqrt(smooth_variance(texel, size));
        vec4 sum = vec4(center.rgb, center.a * KERNEL[0] * KERNEL[0]) * (KERNEL[0] * KERNEL[0]);
        float total = KERNEL[0] * KERNEL[0];
        for (int i = 0; i < 25; ++i) {
            ivec2 step = ivec2(i % 5, i / 5) - 2, other = texel + stride * step;
            if (i == 12 || other != clamp(other, ivec2(0), size - 1)) continue;
            vec4 other_surface = fetch_texel(surfaces, other, size);
            if (other_surface.w == 0.0) continue;
            vec4 value = fetch_texel(source, other, size);
            vec3 offset = view_position(view, texel_uv(other, size, screen_size), other_surface.w) - position;
            float difference = abs(luminance_of(value.rgb) - luminance);
            float weight = KERNEL[abs(step.x)] * KERNEL[abs(step.y)]
                * bilateral_weight(offset, surface.xyz, other_surface.xyz, plane_tolerance)
                * exp(-difference / max(deviation, 1e-6 + 1e-4 * luminance));
            sum += vec4(value.rgb, value.a * weight) * weight;
            total += weight;
        }
        center = vec4(sum.rgb / total, sum.a / (total * total));
    }
#ifdef FINAL
    denoised.rgb = center.rgb * filter_albedo(texelFetch(albedo, texel, 0).rgb);
    vec4 original = texelFetch(radiance, texel, 0);
    denoised = surface.w > 0.0 ? vec4(min(denoised.rgb, 65504.0), original.a) : original;
#else
    filtered = center;
#endif
}
