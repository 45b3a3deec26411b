// The temporal half of SVGF: light over albedo and the moments of its luminance, as means over frames (C. Schied et
// al., "Spatiotemporal Variance-Guided Filtering", 2017).
uniform sampler2D previous_mean;
#ifdef HAS_INSTANCE
uniform sampler2D instance;
#define IS_SAME_OBJECT(texel) (texelFetch(previous_mean, texel, 0).w == current_object())

float current_object() {
    return texelFetch(instance, ivec2(gl_FragCoord.xy), 0).r;
}
#endif
#include "reprojection.glsl"
#include "svgf_albedo.glsl"
#include <luminance.glsl>
uniform sampler2D radiance;
uniform sampler2D albedo;
#ifdef HAS_SAMPLES_TAKEN
uniform sampler2D samples_taken;
#endif
uniform sampler2D previous_moments;
uniform sampler2D previous_source;
out vec4 mean;
out vec2 moments;
out vec4 surfaces;
out vec4 source;

// The light of this frame's samples alone.
vec3 current_light(ivec2 texel) {
    vec3 light = texelFetch(radiance, texel, 0).rgb;
    source = vec4(light, 0.0);
#ifdef HAS_SAMPLES_TAKEN
    // The source is the mean of all samples since the last change.
    source.w = texelFetch(samples_taken, texel, 0).r;
    vec4 before = texelFetch(previous_source, texel, 0);
    if (still_frames > 0 && before.w > 0.0 && source.w > before.w) {
        light = max((light * source.w - before.rgb * before.w) / (source.w - before.w), 0.0);
    }
#endif
    return light;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 light = current_light(texel) / filter_albedo(texelFetch(albedo, texel, 0).rgb);
    float luminance = luminance_of(light);
    mean = vec4(light, 1.0);
    moments = vec2(luminance, luminance * luminance);
    surfaces = vec4(0.0);
    float window_depth = texelFetch(depth, texel, 0).r;
    if (is_nothing(window_depth)) return;
    vec3 surface_normal = normalize(texelFetch(normal, texel, 0).xyz);
    Reprojection r = reproject(texel, window_depth, surface_normal);
    float count = frames_with_current(r);
    if (r.total_weight > 0.0) {
        vec4 mean_sum = vec4(0.0);
        vec2 moments_sum = vec2(0.0);
        for (int i = 0; i < 4; ++i) {
            if (r.weights[i] == 0.0) continue;
            ivec2 other = r.first + ivec2(i & 1, i >> 1);
            mean_sum += r.weights[i] * texelFetch(previous_mean, other, 0);
            moments_sum += r.weights[i] * texelFetch(previous_moments, other, 0).rg;
        }
        mean = mix(mean_sum / r.total_weight, mean, 1.0 / count);
        moments = mix(moments_sum / r.total_weight, moments, 1.0 / count);
    }
#ifdef HAS_INSTANCE
    mean.w = current_object();
#endif
    surfaces = surface_with_count(surface_normal, count, window_depth);
}
