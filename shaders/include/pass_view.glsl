// The view this pass is drawn with: the camera, or a light's, or another's.
#ifndef PASS_VIEW_COUNT
#define PASS_VIEW_COUNT 1
#endif

layout(std140) uniform pass_view_block {
    View pass_views[PASS_VIEW_COUNT];
};
uniform int view_index;
