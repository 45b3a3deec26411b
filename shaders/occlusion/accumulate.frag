// Temporal accumulation: the mean of a noisy picture over frames. Each pixel is reprojected to the previous frame and
// continues the mean of those texels that showed the same surface (C. Schied et al., "Spatiotemporal Variance-Guided
// Filtering", 2017).
#include "reprojection.glsl"
uniform sampler2D source;
uniform sampler2D previous_mean;
out vec4 accumulated;
out vec4 mean;
#ifdef WRITES_SURFACES
out vec4 surfaces;  // world-space normal times the number of frames in the mean; distance along the view axis
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 current = texelFetch(source, texel, 0);
    accumulated = mean = current;
#ifdef WRITES_SURFACES
    surfaces = vec4(0.0);
#endif
    float window_depth = texelFetch(depth, texel, 0).r;
    if (is_nothing(window_depth)) return;
    vec3 surface_normal = normalize(texelFetch(normal, texel, 0).xyz);
    Reprojection r = reproject(texel, window_depth, surface_normal);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        if (r.weights[i] > 0.0) sum += r.weights[i] * texelFetch(previous_mean, r.first + ivec2(i & 1, i >> 1), 0);
    }
    float count = frames_with_current(r);
    if (r.total_weight > 0.0) accumulated = mean = mix(sum / r.total_weight, current, 1.0 / count);
#ifdef WRITES_SURFACES
    surfaces = surface_with_count(surface_normal, count, window_depth);
#endif
}
