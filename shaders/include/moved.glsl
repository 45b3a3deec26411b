// How far a fragment's point has moved since the frame before, of what `transform.glsl` passes on.
#include <previous_pass_view.glsl>
#include <velocity.glsl>

centroid in vec4 v_now;
centroid in vec4 v_before;

vec2 moved() {
    return velocity_between(v_now, PASS_VIEW, v_before, PREVIOUS_PASS_VIEW);
}
