// Temporal accumulation: the mean of a noisy picture over frames. Each pixel is reprojected to the previous frame and
// continues the mean of those texels that showed the same surface (C. Schied et al., "Spatiotemporal Variance-Guided
// Filtering", 2017).
#include "surfaces.glsl"
#include <frame.glsl>
#include <velocity.glsl>
uniform sampler2D source;
uniform sampler2D depth;
uniform sampler2D normal;
#ifdef HAS_VELOCITY
uniform sampler2D velocity;
#endif
uniform sampler2D previous_mean;
uniform sampler2D previous_surfaces;
uniform int frames;
uniform int frames_at_rest;
uniform float tolerance;  // distance from the tangent plane, relative to the distance from the camera
uniform float facing;     // least cosine between the normals
out vec4 accumulated;
out vec4 mean;
out vec4 surfaces;  // world-space normal times the number of frames in the mean; distance along the view axis

// The number of frames in the mean of a texel of the previous frame, 0 if it showed another surface.
float history_length(ivec2 texel, vec3 position, vec3 surface_normal) {
    ivec2 size = textureSize(previous_surfaces, 0);
    if (texel != clamp(texel, ivec2(0), size - 1)) return 0.0;
    vec4 previous = texelFetch(previous_surfaces, texel, 0);
    float count = length(previous.xyz);
    if (count < 0.5 || dot(previous.xyz, surface_normal) < facing * count) return 0.0;
    View previous_view = previous_depth_views[0];
    vec3 previous_view_position = view_position(previous_view, (vec2(texel) + 0.5) / vec2(size), previous.w);
    vec3 previous_position = (previous_view.inverse_view * vec4(previous_view_position, 1.0)).xyz;
    float plane_distance = abs(dot(previous_position - position, surface_normal));
    return plane_distance < tolerance * max(previous.w, previous_view.range.x) ? count : 0.0;
}

void main() {
    View view = depth_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 current = texelFetch(source, texel, 0);
    accumulated = mean = current;
    surfaces = vec4(0.0);
    float window_depth = texelFetch(depth, texel, 0).r;
    if (is_nothing(window_depth)) return;
    vec2 uv = gl_FragCoord.xy * view.viewport.zw;
    vec3 position = world_position(view, uv, window_depth);
    vec3 surface_normal = normalize(texelFetch(normal, texel, 0).xyz);
#ifdef HAS_VELOCITY
    vec2 motion = texelFetch(velocity, texel, 0).xy;
#else
    vec2 motion = static_velocity(view, previous_depth_views[0], uv, window_depth);
#endif
    // Both frames are jittered, each differently.
    vec2 previous_uv = uv - view.jitter.xy - motion + previous_depth_views[0].jitter.xy;
    vec2 previous_texel = previous_uv * view.viewport.xy - 0.5;
    ivec2 first = ivec2(floor(previous_texel + 1e-3));  // static pixels fall on one texel, whatever the rounding
    vec2 fraction = max(previous_texel - vec2(first), 0.0);
    vec4 sum = vec4(0.0);
    float total_weight = 0.0, count = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 corner = ivec2(i & 1, i >> 1);
        vec2 bilinear = mix(1.0 - fraction, fraction, vec2(corner));
        float weight = bilinear.x * bilinear.y;
        float frame_count = weight > 1e-3 ? history_length(first + corner, position, surface_normal) : 0.0;
        if (frame_count == 0.0) continue;
        sum += weight * texelFetch(previous_mean, first + corner, 0);
        count += weight * frame_count;
        total_weight += weight;
    }
    float max_count = float(still_frames > 0 ? max(frames, frames_at_rest) : frames);
    count = 1.0 + (total_weight > 0.0 ? min(floor(count / total_weight + 0.5), max_count - 1.0) : 0.0);
    if (total_weight > 0.0) accumulated = mean = mix(sum / total_weight, current, 1.0 / count);
    surfaces = vec4(surface_normal * count, linear_depth(view, uv, window_depth));
}
