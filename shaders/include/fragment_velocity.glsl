// Screen-space motion of a fragment since the previous frame, from the varyings of `transform.glsl`.
#include <previous_pass_view.glsl>
#include <velocity.glsl>

centroid in vec4 v_clip_position;
centroid in vec4 v_previous_clip_position;

// Motion of this fragment since the previous frame, in widths and heights of the picture; see `velocity_between()`.
vec2 fragment_velocity() {
    return velocity_between(v_clip_position, PASS_VIEW, v_previous_clip_position, PREVIOUS_PASS_VIEW);
}
