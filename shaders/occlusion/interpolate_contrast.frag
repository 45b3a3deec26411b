// Interpolates reduced values at full size where that is as good as computing them: at pixels with reduced ones on
// their own surface, of which those in the same plane differ by at most `contrast`. For all other pixels it writes
// depth 0 as a mask: later passes draw a triangle at the far plane, which passes the depth test there only. The test
// runs before the shader, for whole blocks of pixels. (L. Bavoil and M. Sainz, "Multi-Layer Dual-Resolution
// Screen-Space Ambient Occlusion", 2009)
#include "surfaces.glsl"
#include "outputs.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform float radius;    // of occlusion, in metres
uniform float contrast;  // of ambient visibility
uniform int blur;        // in texels; noisy values, without blur, are not interpolated
out Value interpolated;  // for the passes that filter the masked pixels

void main() {
    View view = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 screen_size = textureSize(surfaces, 0);
    ivec2 size = textureSize(source, 0);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 uv = (vec2(texel) + 0.5) / vec2(screen_size);
    vec3 position = view_position(view, uv, surface.w);
    float tolerance = 0.1 * radius + depth_error(view, surface.w);
    ivec2 first = ivec2(floor(uv * vec2(size) - 0.5));
    ivec2 low = max(first, 0);
    ivec2 high = min(first + 1, size - 1);
    ivec2 low_texel = full_size_texel(low, size, screen_size);
    ivec2 high_texel = full_size_texel(high, size, screen_size);
    vec2 low_uv = (vec2(low_texel) + 0.5) / vec2(screen_size);
    vec2 high_uv = (vec2(high_texel) + 0.5) / vec2(screen_size);
    vec2 fraction = clamp((uv - low_uv) / max(high_uv - low_uv, 1e-6), 0.0, 1.0);
    Value sum = Value(0.0);
    float total_weight = 0.0;
    float minimum = 1.0;
    float maximum = 0.0;
    for (int i = 0; i < 4; ++i) {
        bvec2 corner = bvec2(i & 1, i >> 1);
        vec4 sample_surface = fetch_texel(surfaces, mix(low_texel, high_texel, corner), screen_size);
        Value value = fetch_texel(source, mix(low, high, corner), size).VALUE_CHANNELS;
        vec3 offset = view_position(view, mix(low_uv, high_uv, vec2(corner)), sample_surface.w) - position;
        bool in_plane = sample_surface.w > 0.0 && abs(dot(offset, surface.xyz)) < tolerance;
        vec2 bilinear = mix(1.0 - fraction, fraction, vec2(corner));
        float weight = is_coplanar(offset, surface.xyz, sample_surface.xyz, tolerance) ? bilinear.x * bilinear.y : 0.0;
        sum += weight * value;
        total_weight += weight;
        float visibility = ambient_visibility(value);
        minimum = in_plane ? min(minimum, visibility) : minimum;
        maximum = in_plane ? max(maximum, visibility) : maximum;
    }
    bool needs_computing = blur == 0 || total_weight < 1e-3 || maximum - minimum > contrast;
    // Masks whole quads, because their pixels share samples.
    float mask = needs_computing && surface.w > 0.0 ? 1.0 : 0.0;
    vec2 side = vec2(1 - 2 * (texel & 1));
    mask = max(mask, mask + side.x * dFdxFine(mask));
    mask = max(mask, mask + side.y * dFdyFine(mask));
    interpolated = surface.w > 0.0 && total_weight > 0.0 ? sum / total_weight : OPEN_VALUE;
    write_outputs(interpolated);
    gl_FragDepth = 1.0 - mask;
}
