// PASS_VIEW is the view that this pass is rendered with: the camera's, a light's, or another.
#ifndef PASS_VIEW_COUNT
#define PASS_VIEW_COUNT 1
#endif

layout(std140) uniform pass_view_block {
    View pass_views[PASS_VIEW_COUNT];
};

#if PASS_VIEW_COUNT == 1
#define PASS_VIEW pass_views[0]
#else
uniform int view_index;
#define PASS_VIEW pass_views[view_index]
#endif
