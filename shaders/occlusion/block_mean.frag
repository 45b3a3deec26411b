// The bilateral mean over 4×4 pixels, which together have all sampling directions. Each quad of 2×2 pixels already
// holds its own mean, so four pixels suffice.
#include "surfaces.glsl"
#include "outputs.glsl"
uniform sampler2D unfiltered;
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform float radius;  // of occlusion, in metres

void main() {
    View view = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec4 surface = fetch_texel(surfaces, texel, size);
    if (surface.w == 0.0) {
        write_outputs(OPEN_VALUE);
        return;
    }
    vec3 position = view_position(view, texel_uv(texel, size, screen_size), surface.w);
    float tolerance = 0.1 * radius + depth_error(view, surface.w);
    float total_weight = 1e-3;  // the pixel's own value, in case no neighbour lies on its surface
    Value sum = total_weight * fetch_texel(unfiltered, texel, size).VALUE_CHANNELS;
    for (int i = 0; i < 4; ++i) {
        ivec2 sample_texel = texel + 2 * ivec2(i & 1, i >> 1) - 1;
        if (sample_texel != clamp(sample_texel, ivec2(0), size - 1)) continue;
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        if (sample_surface.w == 0.0) continue;
        vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w) - position;
        float weight = bilateral_weight(offset, surface.xyz, sample_surface.xyz, tolerance);
        sum += weight * fetch_texel(unfiltered, sample_texel, size).VALUE_CHANNELS;
        total_weight += weight;
    }
    write_outputs(sum / total_weight);
}
