// The view this pass was drawn with in the frame before, PREVIOUS_PASS_VIEW.
#include <pass_view.glsl>

layout(std140) uniform previous_pass_view_block {
    View previous_pass_views[PASS_VIEW_COUNT];
};

#if PASS_VIEW_COUNT == 1
#define PREVIOUS_PASS_VIEW previous_pass_views[0]
#else
#define PREVIOUS_PASS_VIEW previous_pass_views[view_index]
#endif
