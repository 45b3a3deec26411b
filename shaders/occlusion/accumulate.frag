// The mean of a noisy picture over frames, looked up where each surface was, among texels that showed the same one
// (C. Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017).
#include "surfaces.glsl"
#include <frame.glsl>
#include <velocity.glsl>
uniform sampler2D source;
uniform sampler2D depth;
uniform sampler2D normal;
#ifdef HAS_VELOCITY
uniform sampler2D velocity;
#endif
uniform sampler2D before;           // last frame's `gathered`
uniform sampler2D surfaces_before;  // last frame's `surfaces`
uniform int frames;
uniform int frames_at_rest;
uniform float tolerance;  // share of the distance
uniform float facing;     // cosine
out vec4 accumulated;
out vec4 gathered;
out vec4 surfaces;  // normal, world space, as long as there are frames in the mean; distance along the view axis

// How many frames a texel of the last frame is the mean of, 0 where it showed another surface than this one.
float frames_of(ivec2 there, vec3 position, vec3 facing_now) {
    ivec2 size = textureSize(surfaces_before, 0);
    if (there != clamp(there, ivec2(0), size - 1)) return 0.0;
    vec4 was = texelFetch(surfaces_before, there, 0);
    float count = length(was.xyz);
    if (count < 0.5 || dot(was.xyz, facing_now) < facing * count) return 0.0;
    View last = previous_depth_views[0];
    vec3 seen = view_position(last, (vec2(there) + 0.5) / vec2(size), was.w);
    vec3 place = (last.inverse_view * vec4(seen, 1.0)).xyz;
    return abs(dot(place - position, facing_now)) < tolerance * max(was.w, last.range.x) ? count : 0.0;
}

void main() {
    View v = depth_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 now = texelFetch(source, texel, 0);
    accumulated = gathered = now;
    surfaces = vec4(0.0);
    float d = texelFetch(depth, texel, 0).r;
    if (is_nothing(d)) return;
    vec2 uv = gl_FragCoord.xy * v.viewport.zw;
    vec3 position = world_position(v, uv, d);
    vec3 facing_now = normalize(texelFetch(normal, texel, 0).xyz);
#ifdef HAS_VELOCITY
    vec2 moved = texelFetch(velocity, texel, 0).xy;
#else
    vec2 moved = static_velocity(v, previous_depth_views[0], uv, d);
#endif
    // Both pictures are jittered, each in its own way.
    vec2 place = (uv - v.jitter.xy - moved + previous_depth_views[0].jitter.xy) * v.viewport.xy - 0.5;
    ivec2 first = ivec2(floor(place + 1e-3));  // what has not moved is one texel's, whatever rounding says
    vec2 part = max(place - vec2(first), 0.0);
    vec4 sum = vec4(0.0);
    float total = 0.0, count = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 way = ivec2(i & 1, i >> 1);
        vec2 share = mix(1.0 - part, part, vec2(way));
        float weight = share.x * share.y;
        float found = weight > 1e-3 ? frames_of(first + way, position, facing_now) : 0.0;
        if (found == 0.0) continue;
        sum += weight * texelFetch(before, first + way, 0);
        count += weight * found;
        total += weight;
    }
    float most = float(still_frames > 0 ? max(frames, frames_at_rest) : frames);
    count = 1.0 + (total > 0.0 ? min(floor(count / total + 0.5), most - 1.0) : 0.0);
    if (total > 0.0) accumulated = gathered = mix(sum / total, now, 1.0 / count);
    surfaces = vec4(facing_now * count, linear_depth(v, uv, d));
}
