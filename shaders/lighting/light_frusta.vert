// The twelve edges of the view frustum of each layer of a shadow map.
#include <layer_colors.glsl>
#include <pass_view.glsl>

flat out vec3 g_tint;

void main() {
    int edge = gl_VertexID / 2, axis = edge / 4;
    ivec3 corner;  // 0 or 1 along each axis: the end of the edge along its own axis, the edge's index along the others
    corner[axis] = gl_VertexID & 1;
    corner[(axis + 1) % 3] = edge & 1;
    corner[(axis + 2) % 3] = edge >> 1 & 1;
    vec4 clip_position = vec4(vec2(corner.xy) * 2.0 - 1.0, float(corner.z), 1.0);
    vec4 position = shadow_map_views[gl_InstanceID].inverse_view_projection * clip_position;
    gl_Position = PASS_VIEW.view_projection * (position / position.w);
    g_tint = layer_color(gl_InstanceID);
}
