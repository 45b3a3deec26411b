// Transforms a vertex of the scene to world and clip space, and writes all varyings. The linker removes the ones that
// no later stage reads. With multisampling, a triangle may miss the pixel centre, so varyings are interpolated at the
// centroid, which lies on the surface. The position is also interpolated at the pixel centre, as `v_position`: its
// derivatives lie in the plane of the triangle.
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

#ifdef HAS_TRANSMISSION
flat out float v_scale;  // of the object: the cube root of its scale of volumes
#endif

// Writes gl_Position and every varying of this vertex: `v_position`, `v_normal`, `v_object`, those of the material, of
// the tangent frame and of the velocity.
void transform_vertex() {
    v_position = object_to_world(in_position);
#if PASS_SAMPLES > 1
    // w is 1, in a form that compilers do not fold to a constant.
    v_centroid_position = vec4(v_position, PASS_VIEW.viewport.x * PASS_VIEW.viewport.z);
#endif
    v_normal = normal_to_world(in_normal);
    write_material_varyings();
    v_object = in_ids.y;
#ifdef HAS_TANGENT
    v_tangent = vec4(direction_to_world(in_tangent.xyz), in_tangent.w * handedness());
#endif
#ifdef HAS_TRANSMISSION
    v_scale = pow(abs(dot(in_object0.xyz, cross(in_object1.xyz, in_object2.xyz))), 1.0 / 3.0);
#endif
    write_velocity_varyings();
    gl_Position = world_to_clip(v_position);
}
