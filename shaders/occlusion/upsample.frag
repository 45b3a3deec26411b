// Joint bilateral upsampling (J. Kopf et al., 2007): bilinear interpolation of the reduced texels on the pixel's own
// surface, or of all four if there are none.
#include "surfaces.glsl"
#include "outputs.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;  // reduced
uniform sampler2D depth;
uniform sampler2D normal;
uniform float radius;        // of occlusion, in metres

void main() {
    View view = depth_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    ivec2 screen_size = textureSize(depth, 0);
    float window_depth = texelFetch(depth, texel, 0).r;
    if (is_nothing(window_depth)) {
        write_outputs(OPEN_VALUE);
        return;
    }
    float distance = linear_depth(view, window_depth);
    vec2 uv = (vec2(texel) + 0.5) / vec2(screen_size);
    vec3 position = view_position(view, uv, distance);
    vec3 view_normal = normalize(mat3(view.view) * texelFetch(normal, texel, 0).xyz);
    vec2 source_position = uv * vec2(size) - 0.5;
    ivec2 first = ivec2(floor(source_position));
    vec2 fraction = source_position - vec2(first);
    Value sum = Value(0.0);
    float total_weight = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 corner = ivec2(i & 1, i >> 1);
        ivec2 sample_texel = clamp(first + corner, ivec2(0), size - 1);
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        if (sample_surface.w == 0.0) continue;
        vec2 bilinear = mix(1.0 - fraction, fraction, vec2(corner)) + 1e-3;
        vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w) - position;
        float tolerance = 0.1 * radius + depth_error(view, distance);
        float similarity = bilateral_weight(offset, view_normal, sample_surface.xyz, tolerance);
        float weight = bilinear.x * bilinear.y * (similarity + 1e-4);
        sum += weight * fetch_texel(source, sample_texel, size).VALUE_CHANNELS;
        total_weight += weight;
    }
    write_outputs(total_weight > 0.0 ? sum / total_weight : OPEN_VALUE);
}
