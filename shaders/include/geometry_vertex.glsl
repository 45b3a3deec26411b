// One vertex of the scene in world and clip space. What no later stage reads, the linker takes out again. Where a pixel
// has several samples, a surface that misses its middle is interpolated where it is (`centroid`). The position is
// there twice: `v_centroid_position` on the surface, and `v_position` in the middle of pixels, whose derivatives are the
// triangle's plane.
#include <material_vertex.glsl>
#include <transform.glsl>

in vec3 in_normal;

out vec3 v_position;
#if PASS_SAMPLES > 1
centroid out vec4 v_centroid_position;
#endif
centroid out vec3 v_normal;
flat out int v_object;

#ifdef HAS_TANGENT
in vec4 in_tangent;
centroid out vec4 v_tangent;
#endif

void transform_vertex() {
    v_position = object_to_world(in_position);
#if PASS_SAMPLES > 1
    v_centroid_position = vec4(v_position, PASS_VIEW.viewport.x * PASS_VIEW.viewport.z);  // 1, and no compiler sees that it is
#endif
    v_normal = normal_to_world(in_normal);
    write_material_varyings();
    v_object = in_ids.y;
#ifdef HAS_TANGENT
    v_tangent = vec4(direction_to_world(in_tangent.xyz), in_tangent.w * handedness());
#endif
    write_velocity_varyings();
    gl_Position = world_to_clip(v_position);
}
