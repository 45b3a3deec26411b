// Deforms the vertices of one mesh by morph targets and joints, once for each pose, and writes the streams that all
// passes read: p' = sum over joints of weight * matrix * (p + sum over targets of weight * displacement), as in glTF
// 2.0 §3.7.2 and §3.7.3. Normals are transformed by the cofactor matrix, which is right for any scale.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer rest_block {
    // For each vertex: position, normal, tangent if there is one, its joints, their weights, and for each target the
    // displacements of position, normal and tangent, if there are any.
    float rest[];
};
layout(std430, binding = 1) readonly buffer pose_block {
    float pose[];  // for each mesh: rows of its joints' matrices, 12 floats each, then the weights of its targets
};
layout(std430, binding = 2) writeonly buffer position_block {
    float positions[];
};
layout(std430, binding = 3) writeonly buffer normal_block {
    float normals[];
};
#ifdef TANGENTS
layout(std430, binding = 4) writeonly buffer tangent_block {
    float tangents[];
};
#endif
#ifdef SCENE_DATA
layout(std430, binding = 5) writeonly buffer vertex_block {
    float vertices[];  // `scene_vertices` of `scene.glsl`
};
uniform int vertex_width;  // floats per vertex
#endif

uniform ivec4 mesh;    // first vertex in the streams, number of vertices, where the mesh begins in `rest`, in `pose`
uniform ivec4 sizes;  // joints of a vertex, joints, targets, floats of a vertex in `rest`
uniform ivec2 displaced;  // whether targets displace normals, tangents

vec3 read3(int at) {
    return vec3(rest[at], rest[at + 1], rest[at + 2]);
}

vec3 unit(vec3 v) {
    v /= max(max(abs(v.x), abs(v.y)), max(abs(v.z), 1e-37));
    return v * inversesqrt(max(dot(v, v), 1e-37));
}

void main() {
    int vertex = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64 + int(gl_LocalInvocationID.x);
    if (vertex >= mesh.y) return;
    int at = mesh.z + vertex * sizes.w;
    vec3 p = read3(at), n = read3(at + 3);
    at += 6;
#ifdef TANGENTS
    vec3 t = read3(at);
    float hand = rest[at + 3];
    at += 4;
#endif
    int joints = at, weights = mesh.w + 12 * sizes.y;
    at += 2 * sizes.x;
    for (int target = 0; target < sizes.z; ++target) {
        float w = pose[weights + target];
        p += w * read3(at);
        at += 3;
        if (displaced.x != 0) {
            n += w * read3(at);
            at += 3;
        }
        if (displaced.y != 0) {
#ifdef TANGENTS
            t += w * read3(at);
#endif
            at += 3;
        }
    }
    if (sizes.x > 0) {
        vec4 r0 = vec4(0.0), r1 = vec4(0.0), r2 = vec4(0.0);
        for (int i = 0; i < sizes.x; ++i) {
            float w = rest[joints + sizes.x + i];
            int m = mesh.w + 12 * int(rest[joints + i]);
            r0 += w * vec4(pose[m], pose[m + 1], pose[m + 2], pose[m + 3]);
            r1 += w * vec4(pose[m + 4], pose[m + 5], pose[m + 6], pose[m + 7]);
            r2 += w * vec4(pose[m + 8], pose[m + 9], pose[m + 10], pose[m + 11]);
        }
        p = vec3(dot(r0, vec4(p, 1.0)), dot(r1, vec4(p, 1.0)), dot(r2, vec4(p, 1.0)));
        vec3 c0 = cross(r1.xyz, r2.xyz), c1 = cross(r2.xyz, r0.xyz), c2 = cross(r0.xyz, r1.xyz);
        n = vec3(dot(c0, n), dot(c1, n), dot(c2, n)) * sign(dot(r0.xyz, c0));
#ifdef TANGENTS
        t = vec3(dot(r0.xyz, t), dot(r1.xyz, t), dot(r2.xyz, t));
#endif
    }
    n = unit(n);
    int to = mesh.x + vertex;
    for (int i = 0; i < 3; ++i) {
        positions[3 * to + i] = p[i];
        normals[3 * to + i] = n[i];
#ifdef SCENE_DATA
        vertices[vertex_width * to + i] = p[i];
        vertices[vertex_width * to + 3 + i] = n[i];
#endif
    }
#ifdef TANGENTS
    vec4 tangent = vec4(unit(t), hand);
    for (int i = 0; i < 4; ++i) {
        tangents[4 * to + i] = tangent[i];
#ifdef SCENE_DATA
        vertices[vertex_width * to + 6 + i] = tangent[i];
#endif
    }
#endif
}
