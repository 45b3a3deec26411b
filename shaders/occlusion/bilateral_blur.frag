// One axis of a separable bilateral blur (C. Tomasi and R. Manduchi, "Bilateral Filtering for Gray and Color Images",
// 1998, with weights from surfaces in place of colours). Each quad of 2×2 texels holds its mean, so the blur reads
// every other texel, and weights the ends so that the kernel is centred on the texel.
#include "surfaces.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform ivec2 axis;    // (1, 0) or (0, 1)
uniform int blur;      // kernel radius in texels
uniform float radius;  // of occlusion, in metres
out float blurred;

void main() {
    View view = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    ivec2 last = target_size(size) - 1;
    ivec2 texel = current_surface_texel(size);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec3 position = view_position(view, texel_uv(texel, size, screen_size), surface.w);
    float tolerance = 0.1 * radius + depth_error(view, surface.w);
    ivec2 odd = pixel & axis;
#ifdef SPARSE
    int kernel_radius = blur * 3 >> 2;  // smaller, because reduced pixels have more samples and are farther apart
#else
    int kernel_radius = blur;
#endif
    int last_tap = kernel_radius >> 1 << 1;
    float quad_center = 0.5 - float(odd.x + odd.y);  // relative to the texel
    float total_weight = 1e-3;  // the texel's own value, in case no tap lies on its surface
    float sum = total_weight * texelFetch(source, pixel, 0).r;
    for (int i = -last_tap; i <= last_tap; i += 2) {
        ivec2 sample_pixel = clamp(pixel + i * axis, ivec2(0), last);
        ivec2 sample_texel = surface_texel(sample_pixel, size);
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w) - position;
        float kernel = clamp(0.5 * (float(kernel_radius) + 1.0 - abs(float(i) + quad_center)), 0.0, 1.0);
        float weight = kernel * bilateral_weight(offset, surface.xyz, sample_surface.xyz, tolerance);
        sum += weight * fetch_texel(source, sample_pixel, last + 1).r;
        total_weight += weight;
    }
    blurred = sum / total_weight;
}
