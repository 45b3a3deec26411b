// PREVIOUS_PASS_VIEW is the view that this pass was rendered with in the previous frame.
#include <pass_view.glsl>

layout(std140) uniform previous_pass_view_block {
    View previous_pass_views[PASS_VIEW_COUNT];
};

#if PASS_VIEW_COUNT == 1
#define PREVIOUS_PASS_VIEW previous_pass_views[0]
#else
#define PREVIOUS_PASS_VIEW previous_pass_views[view_index]
#endif
