// Transforms from object to world to clip space. All passes share this code, so that positions are bit-identical.
#include <pass_view.glsl>

in vec3 in_position;
in vec4 in_object0;  // rows of the affine object-to-world matrix, per instance
in vec4 in_object1;
in vec4 in_object2;
#ifdef WRITES_VELOCITY
#include <previous_pass_view.glsl>
in vec4 in_previous0;  // the same rows in the previous frame
in vec4 in_previous1;
in vec4 in_previous2;
#ifdef SCENE_POSED
in vec3 in_previous_position;  // object space, in the previous frame
#endif
centroid out vec4 v_clip_position;
centroid out vec4 v_previous_clip_position;
#endif

invariant gl_Position;

// World-space position of an object-space position `p`.
vec3 object_to_world(vec3 p) {
    vec4 q = vec4(p, 1.0);
    return vec3(dot(in_object0, q), dot(in_object1, q), dot(in_object2, q));
}

// World-space vector of an object-space direction `d`; not normalized.
vec3 direction_to_world(vec3 d) {
    return vec3(dot(in_object0.xyz, d), dot(in_object1.xyz, d), dot(in_object2.xyz, d));
}

// -1 if the object-to-world matrix mirrors, else 1.
float handedness() {
    return dot(in_object0.xyz, cross(in_object1.xyz, in_object2.xyz)) < 0.0 ? -1.0 : 1.0;
}

// World-space normal of an object-space normal `n`; a unit vector, unless UNIFORM_SCALE is defined. Normals are
// transformed by the cofactor matrix, which is right for any scale, times the sign of the determinant for mirrored
// objects. With UNIFORM_SCALE all objects have uniform scale, and the matrix itself is enough.
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

// Clip-space position of a world-space position in the view of this pass.
vec4 world_to_clip(vec3 position) {
    return PASS_VIEW.view_projection * vec4(position, 1.0);
}

// Object-space position of the vertex in the previous frame; it differs from the current one if skins or morph targets
// move it.
vec3 previous_vertex_position() {
#if defined(WRITES_VELOCITY) && defined(SCENE_POSED)
    return in_previous_position;
#else
    return in_position;
#endif
}

// World-space position in the previous frame of a point `p` of the object; in a pass without velocity, in this frame.
vec3 previous_object_to_world(vec3 p) {
#ifdef WRITES_VELOCITY
    vec4 q = vec4(p, 1.0);
    return vec3(dot(in_previous0, q), dot(in_previous1, q), dot(in_previous2, q));
#else
    return object_to_world(p);
#endif
}

// Writes the clip-space positions in this frame and the previous one, for `fragment_velocity()`. `position` and
// `previous_position` are where the vertex is and was in world space; vertex shaders that move vertices call this form.
void write_velocity_varyings(vec3 position, vec3 previous_position) {
#ifdef WRITES_VELOCITY
    v_clip_position = world_to_clip(position);
    v_previous_clip_position = PREVIOUS_PASS_VIEW.view_projection * vec4(previous_position, 1.0);
#endif
}

// The same for a vertex that only moves with its object.
void write_velocity_varyings() {
    write_velocity_varyings(object_to_world(in_position), previous_object_to_world(previous_vertex_position()));
}
