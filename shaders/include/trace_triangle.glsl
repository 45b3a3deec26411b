// The test of rays against triangles of the scene.
#include <ray_query.glsl>

// The axes in an order that ends with `last`, without mirroring.
vec3 trace_permuted(vec3 v, int last) {
    return last == 2 ? v : last == 0 ? v.yzx : v.zxy;
}

// Tests the next triangle of the leaf that waits in `q`; true if the query stops at it. `triangles_at` is the row where
// triangles begin. The test is that of S. Woop, C. Benthin and I. Wald ("Watertight Ray/Triangle Intersection", 2013):
// no ray passes between two triangles that share an edge.
bool trace_triangle(inout RayQuery q, int triangles_at) {
    bool is_leaf = q.leaf < 0;
    int leaf = is_leaf ? -1 - q.leaf : 0, at = triangles_at + 3 * (leaf >> 2);
    ivec4 first = SCENE_TREE(at), second = SCENE_TREE(at + 1), third = SCENE_TREE(at + 2);
    // Triangles must compute the same numbers for a shared edge: no fused multiply-add is allowed.
    precise vec3 p0 = trace_permuted(intBitsToFloat(first.xyz) - q.object_origin, q.axis);
    precise vec3 p1 = trace_permuted(intBitsToFloat(second.xyz) - q.object_origin, q.axis);
    precise vec3 p2 = trace_permuted(intBitsToFloat(third.xyz) - q.object_origin, q.axis);
    p0.xy -= q.shear.xy * p0.z;
    p1.xy -= q.shear.xy * p1.z;
    p2.xy -= q.shear.xy * p2.z;
    precise vec3 edges = vec3(p2.x * p1.y - p2.y * p1.x, p0.x * p2.y - p0.y * p2.x, p1.x * p0.y - p1.y * p0.x);
    float sum = edges.x + edges.y + edges.z, over = 1.0 / sum;
    bool inside = all(greaterThanEqual(edges, vec3(0.0))) || all(lessThanEqual(edges, vec3(0.0)));
    float distance = dot(edges, vec3(p0.z, p1.z, p2.z)) * q.shear.z * over;
    int own = third.w < 0 ? q.flags : third.w;
    bool is_hit = is_leaf && inside && sum != 0.0 && distance > q.nearest && distance < q.hit.distance
        && (own & q.wanted) == q.wanted && (own & q.rejected) == 0;
    bool stops = is_hit && (own & q.asks) != 0, ends = is_hit && !stops && q.any;
    q.leaf = is_leaf && (leaf & 3) != 0 && !ends ? q.leaf - 3 : 0;  // a leaf of the others
    q.node = ends ? TRACE_END : q.node;
    if (is_hit) q.candidate = Hit(distance, third.w < 0 ? q.instance : second.w, first.w, edges.yz * over);
    if (is_hit && !stops) q.hit = q.candidate;
    return stops;
}
