// The twelve edges of what each layer of a shadow map sees.
#include <layer_colors.glsl>
#include <pass_view.glsl>

flat out vec3 g_tint;

void main() {
    int line = gl_VertexID / 2, axis = line / 4;
    ivec3 corner;  // 0 or 1: either end along the line's axis, the bits of its number along the others
    corner[axis] = gl_VertexID & 1;
    corner[(axis + 1) % 3] = line & 1;
    corner[(axis + 2) % 3] = line >> 1 & 1;
    vec4 clip = vec4(vec2(corner.xy) * 2.0 - 1.0, float(corner.z), 1.0);
    vec4 place = shadow_map_views[gl_InstanceID].inverse_view_projection * clip;
    gl_Position = PASS_VIEW.view_projection * (place / place.w);
    g_tint = layer_color(gl_InstanceID);
}
