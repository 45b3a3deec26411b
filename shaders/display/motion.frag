// How far each pixel's surface moves during half of the exposure, and a copy of the picture to gather from.
#include <velocity.glsl>

uniform sampler2D radiance;
uniform sampler2D depth;
#ifdef HAS_VELOCITY
uniform sampler2D velocity;
#endif
uniform float shutter;  // share of a frame's time
in vec2 v_uv;
out vec4 sharp;
out vec4 motion;  // xy half the motion in pixels, z the distance in metres, w the length of xy

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    sharp = texelFetch(radiance, texel, 0);
    float window_depth = texelFetch(depth, texel, 0).r;
    vec2 camera_motion = static_velocity(depth_views[0], previous_depth_views[0], v_uv, window_depth);
    vec2 moved = camera_motion;
#ifdef HAS_VELOCITY
    if (!is_nothing(window_depth)) moved = texelFetch(velocity, texel, 0).xy;
#endif
    if (any(greaterThan(abs(moved), vec2(1.0)))) moved = vec2(0.0);  // it was behind the camera
#if !CAMERA_MOTION
    moved -= camera_motion;
#endif
#if !OBJECT_MOTION
    moved = camera_motion;
#endif
#if !CAMERA_MOTION && !OBJECT_MOTION
    moved = vec2(0.0);
#endif
    vec2 half_motion = 0.5 * shutter * moved * vec2(textureSize(radiance, 0));
    half_motion *= min(1.0, float(REACH) / max(length(half_motion), 1e-6));
    float z = is_nothing(window_depth) ? 60000.0 : linear_depth(depth_views[0], v_uv, window_depth);
    motion = vec4(half_motion, min(z, 60000.0), length(half_motion));
}
