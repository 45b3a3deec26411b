// Object to world to clip space, written once so that every pass gets the same positions to the last bit.
#include <pass_view.glsl>

in vec3 in_position;
in vec4 in_object0;  // rows of the affine object-to-world matrix, per instance
in vec4 in_object1;
in vec4 in_object2;
#ifdef WRITES_VELOCITY
#include <previous_pass_view.glsl>
in vec4 in_previous0;  // the same in the frame before
in vec4 in_previous1;
in vec4 in_previous2;
centroid out vec4 v_clip_position;  // where a point is and was, in clip space
centroid out vec4 v_previous_clip_position;
#endif

invariant gl_Position;

vec3 object_to_world(vec3 p) {
    vec4 q = vec4(p, 1.0);
    return vec3(dot(in_object0, q), dot(in_object1, q), dot(in_object2, q));
}

vec3 direction_to_world(vec3 d) {
    return vec3(dot(in_object0.xyz, d), dot(in_object1.xyz, d), dot(in_object2.xyz, d));
}

// -1 where the transform mirrors.
float handedness() {
    return dot(in_object0.xyz, cross(in_object1.xyz, in_object2.xyz)) < 0.0 ? -1.0 : 1.0;
}

// Normals go by the cofactor matrix: right for any scale, and with the sign of the determinant for mirrored objects.
// Where every object is only turned, moved and scaled evenly (UNIFORM_SCALE) the matrix itself does.
vec3 normal_to_world(vec3 n) {
#ifdef UNIFORM_SCALE
    return direction_to_world(n);
#else
    vec3 c0 = cross(in_object1.xyz, in_object2.xyz);
    vec3 c1 = cross(in_object2.xyz, in_object0.xyz);
    vec3 c2 = cross(in_object0.xyz, in_object1.xyz);
    vec3 world = vec3(dot(c0, n), dot(c1, n), dot(c2, n)) * sign(dot(in_object0.xyz, c0));
    return world * inversesqrt(max(dot(world, world), 1e-30));
#endif
}

vec4 world_to_clip(vec3 position) {
    return PASS_VIEW.view_projection * vec4(position, 1.0);
}

// What a fragment needs to know how far its point has moved; `velocity.glsl` says that.
void write_velocity_varyings() {
#ifdef WRITES_VELOCITY
    vec4 q = vec4(in_position, 1.0);
    vec3 before = vec3(dot(in_previous0, q), dot(in_previous1, q), dot(in_previous2, q));
    v_clip_position = world_to_clip(object_to_world(in_position));
    v_previous_clip_position = PREVIOUS_PASS_VIEW.view_projection * vec4(before, 1.0);
#endif
}
