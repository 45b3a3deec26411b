// Where the surface of a pixel was in the previous frame, and which texels there showed the same surface: in the same
// plane, with a similar normal. A shader that knows the objects defines IS_SAME_OBJECT(texel) before, for texels of the
// previous frame.
#include "surfaces.glsl"
#include <frame.glsl>
#include <velocity.glsl>
uniform sampler2D depth;
uniform sampler2D normal;
#ifdef HAS_VELOCITY
uniform sampler2D velocity;
#endif
uniform sampler2D previous_surfaces;  // written by `surface_with_count`
uniform int frames;
uniform int frames_at_rest;
uniform float tolerance;  // distance from the tangent plane, relative to the distance from the camera
uniform float facing;     // least cosine between the normals

struct Reprojection {
    ivec2 first;         // of the four nearest texels
    float weights[4];    // bilinear, 0 for other surfaces; the right texel follows the left, then the two above
    float total_weight;  // 0 where the surface was hidden or outside the picture
    float count;         // sum of weights times frames in the mean
};

// The number of frames in the mean of a texel of the previous frame, 0 if it showed another surface.
float history_length(ivec2 texel, vec3 position, vec3 surface_normal) {
    ivec2 size = textureSize(previous_surfaces, 0);
    if (texel != clamp(texel, ivec2(0), size - 1)) return 0.0;
#ifdef IS_SAME_OBJECT
    if (!IS_SAME_OBJECT(texel)) return 0.0;
#endif
    vec4 previous = texelFetch(previous_surfaces, texel, 0);
    float count = length(previous.xyz);
    if (count < 0.5 || dot(previous.xyz, surface_normal) < facing * count) return 0.0;
    View previous_view = previous_depth_views[0];
    vec3 previous_view_position = view_position(previous_view, (vec2(texel) + 0.5) / vec2(size), previous.w);
    vec3 previous_position = (previous_view.inverse_view * vec4(previous_view_position, 1.0)).xyz;
    float plane_distance = abs(dot(previous_position - position, surface_normal));
    return plane_distance < tolerance * max(previous.w, previous_view.range.x) ? count : 0.0;
}

// The texels of the previous frame that continue in the current pixel, which shows a surface.
Reprojection reproject(ivec2 texel, float window_depth, vec3 surface_normal) {
    View view = depth_views[0];
    vec2 uv = gl_FragCoord.xy * view.viewport.zw;
    vec3 position = world_position(view, uv, window_depth);
#ifdef HAS_VELOCITY
    vec2 motion = texelFetch(velocity, texel, 0).xy;
#else
    vec2 motion = static_velocity(view, previous_depth_views[0], uv, window_depth);
#endif
    // Both frames are jittered, each differently.
    vec2 previous_uv = uv - view.jitter.xy - motion + previous_depth_views[0].jitter.xy;
    vec2 previous_texel = previous_uv * view.viewport.xy - 0.5;
    Reprojection r;
    r.first = ivec2(floor(previous_texel + 1e-3));  // static pixels fall on one texel, regardless of rounding
    vec2 fraction = max(previous_texel - vec2(r.first), 0.0);
    r.total_weight = r.count = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 corner = ivec2(i & 1, i >> 1);
        vec2 bilinear = mix(1.0 - fraction, fraction, vec2(corner));
        float weight = bilinear.x * bilinear.y;
        float frame_count = weight > 1e-3 ? history_length(r.first + corner, position, surface_normal) : 0.0;
        r.weights[i] = frame_count > 0.0 ? weight : 0.0;
        if (frame_count == 0.0) continue;
        r.count += weight * frame_count;
        r.total_weight += weight;
    }
    return r;
}

// The number of frames in the mean that the current one continues.
float frames_with_current(Reprojection r) {
    float max_count = float(still_frames > 0 ? max(frames, frames_at_rest) : frames);
    return 1.0 + (r.total_weight > 0.0 ? min(floor(r.count / r.total_weight + 0.5), max_count - 1.0) : 0.0);
}

// Data that the next frame compares its surfaces with: world-space normal times the number of frames in the mean, and
// the distance along the view axis.
vec4 surface_with_count(vec3 surface_normal, float count, float window_depth) {
    vec2 uv = gl_FragCoord.xy * depth_views[0].viewport.zw;
    return vec4(surface_normal * count, linear_depth(depth_views[0], uv, window_depth));
}
