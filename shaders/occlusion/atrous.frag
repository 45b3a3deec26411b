// One pass of the à-trous wavelet filter: the bilateral mean of 3×3 texels that are `stride` apart (H. Dammertz et al.,
// "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering", 2010). Passes with doubled strides
// cover a wide area with few texels.
#include "surfaces.glsl"
#include "outputs.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform int stride;
uniform float tolerance;  // distance from the tangent plane, in metres

void main() {
    View view = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 surface = texelFetch(surfaces, texel, 0);
    Value value = texelFetch(source, texel, 0).VALUE_CHANNELS;
    if (surface.w == 0.0) {
        write_outputs(value);
        return;
    }
    vec3 position = view_position(view, texel_uv(texel, size, screen_size), surface.w);
    float plane_tolerance = tolerance + depth_error(view, surface.w);
    Value sum = 4.0 * value;
    float total_weight = 4.0;
    for (int i = 0; i < 9; ++i) {
        if (i == 4) continue;
        ivec2 step = ivec2(i % 3, i / 3) - 1;
        ivec2 sample_texel = texel + stride * step;
        if (sample_texel != clamp(sample_texel, ivec2(0), size - 1)) continue;
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        if (sample_surface.w == 0.0) continue;
        vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w) - position;
        float weight = (step.x * step.y == 0 ? 2.0 : 1.0)
            * bilateral_weight(offset, surface.xyz, sample_surface.xyz, plane_tolerance);
        sum += weight * fetch_texel(source, sample_texel, size).VALUE_CHANNELS;
        total_weight += weight;
    }
    sum /= total_weight;
#ifdef KEEP_VISIBILITY
    sum.w = value.w;
#endif
    write_outputs(sum);
}
