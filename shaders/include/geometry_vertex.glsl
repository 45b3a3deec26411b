// One vertex of the scene in world and clip space. What no later stage reads, the linker takes out again.
#include <transform.glsl>

in vec3 in_normal;
in ivec2 in_ids;  // material, object

out vec3 v_position;
out vec3 v_normal;
flat out int v_material;
flat out int v_object;

#ifdef HAS_UV0
in vec2 in_uv0;
out vec2 v_uv0;
#endif
#ifdef HAS_UV1
in vec2 in_uv1;
out vec2 v_uv1;
#endif
#ifdef HAS_TANGENT
in vec4 in_tangent;
out vec4 v_tangent;
#endif
#ifdef HAS_VERTEX_COLOR
in vec4 in_color;
out vec4 v_color;
#endif

void pass_vertex_on() {
    v_position = object_to_world(in_position);
    v_normal = normal_to_world(in_normal);
    v_material = in_ids.x;
    v_object = in_ids.y;
#ifdef HAS_UV0
    v_uv0 = in_uv0;
#endif
#ifdef HAS_UV1
    v_uv1 = in_uv1;
#endif
#ifdef HAS_TANGENT
    v_tangent = vec4(direction_to_world(in_tangent.xyz), in_tangent.w * handedness());
#endif
#ifdef HAS_VERTEX_COLOR
    v_color = in_color;
#endif
    gl_Position = world_to_clip(v_position);
}
