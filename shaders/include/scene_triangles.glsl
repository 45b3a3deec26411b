// Triangles of the scene as data in world space: corners, points and normals.
#include <scene_buffers.glsl>

// World-space position of an object-space `point` of an instance.
vec3 scene_point_to_world(int instance, vec3 point) {
    vec4 rows[3] = scene_instance(instance).rows;
    vec4 p = vec4(point, 1.0);
    return vec3(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
}

// World-space vector of an object-space `direction` of an instance; not normalized.
vec3 scene_direction_to_world(int instance, vec3 direction) {
    vec4 rows[3] = scene_instance(instance).rows;
    return vec3(dot(rows[0].xyz, direction), dot(rows[1].xyz, direction), dot(rows[2].xyz, direction));
}

// Like `normal_to_world()` of `transform.glsl`: the cofactor matrix, with the sign of the determinant.
vec3 scene_normal_to_world(int instance, vec3 normal) {
    vec4 rows[3] = scene_instance(instance).rows;
#ifdef UNIFORM_SCALE
    return scene_direction_to_world(instance, normal);
#else
    vec3 c0 = cross(rows[1].xyz, rows[2].xyz), c1 = cross(rows[2].xyz, rows[0].xyz);
    vec3 c2 = cross(rows[0].xyz, rows[1].xyz);
    vec3 world = vec3(dot(c0, normal), dot(c1, normal), dot(c2, normal)) * sign(dot(rows[0].xyz, c0));
    return world * inversesqrt(max(dot(world, world), 1e-30));
#endif
}

// Weights of a triangle's three vertices at a point.
vec3 scene_weights(vec2 barycentrics) {
    return vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics);
}

// World-space corners of a triangle, as columns.
mat3 scene_corners(int instance, int triangle) {
    ivec3 v = scene_triangle(instance, triangle);
    return mat3(
        scene_point_to_world(instance, scene_vertex_position(v.x)),
        scene_point_to_world(instance, scene_vertex_position(v.y)),
        scene_point_to_world(instance, scene_vertex_position(v.z)));
}

// World-space position of a point of a triangle.
vec3 scene_position(int instance, int triangle, vec2 barycentrics) {
    return scene_corners(instance, triangle) * scene_weights(barycentrics);
}

// Barycentrics of a world-space point in the plane of a triangle.
vec2 scene_barycentrics(int instance, int triangle, vec3 position) {
    mat3 p = scene_corners(instance, triangle);
    vec3 a = p[1] - p[0], b = p[2] - p[0], offset = position - p[0];
    vec3 normal = cross(a, b);
    return vec2(dot(cross(offset, b), normal), dot(cross(a, offset), normal)) / max(dot(normal, normal), 1e-37);
}

// Unit normal of a triangle on its front side, where its vertices run counter-clockwise, or clockwise for mirrored
// objects, whose winding is reversed.
vec3 scene_geometric_normal(int instance, int triangle) {
    mat3 p = scene_corners(instance, triangle);
    vec3 normal = cross(p[1] - p[0], p[2] - p[0]);
    normal *= inversesqrt(max(dot(normal, normal), 1e-37));
    return scene_has(instance, SCENE_MIRRORED) ? -normal : normal;
}
