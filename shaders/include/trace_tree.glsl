// Traversal of the trees over objects and triangles. `trace.glsl` has the queries for shaders to call.
#include <ray_query.glsl>

// The axes in an order that ends with `last`, without mirroring.
vec3 trace_permuted(vec3 v, int last) {
    return last == 2 ? v : last == 0 ? v.yzx : v.zxy;
}

// Continues the query `q`: true where it has stopped at a candidate, false where it has ended. The triangle test is
// that of S. Woop, C. Benthin and I. Wald ("Watertight Ray/Triangle Intersection", 2013): no ray passes between two
// triangles that share an edge.
//
// Each iteration of the inner loop visits two nodes and tests a triangle, and invocations leave it only at the end of
// the tree. Those that run in lockstep then do the same work most of the time, and the set of active ones seldom
// changes, so llvmpipe's branches are predictable. The stack cannot overflow: depths of trees are limited when they are
// built, and TRACE_STACK follows from the limits.
bool find_candidate(inout RayQuery q) {
    ivec4 header = SCENE_TREE(0), header2 = SCENE_TREE(1);
    vec3 top_origin = (q.origin - intBitsToFloat(header.xyz)) * intBitsToFloat(header2.xyz);
    vec3 top_inverse = trace_inverse(q.direction * intBitsToFloat(header2.xyz));
    int node = q.node, top = q.top, after = TRACE_END;
    bool stops = false;
    do {
        if (node == TRACE_UP) {
            q.in_mesh = false;
            q.grid_origin = top_origin;
            q.inverse = top_inverse;
            --top;
            node = trace_stack[top];
        }
        if (node < 0 && !q.in_mesh) {  // an object
            q.instance = -1 - node;
            int at = 2 + 5 * q.instance;
            ivec4 r0 = SCENE_TREE(at), r1 = SCENE_TREE(at + 1), r2 = SCENE_TREE(at + 2);
            ivec4 low = SCENE_TREE(at + 3), scale = SCENE_TREE(at + 4);
            vec4 m0 = intBitsToFloat(r0), m1 = intBitsToFloat(r1), m2 = intBitsToFloat(r2), o = vec4(q.origin, 1.0);
            q.object_origin = vec3(dot(m0, o), dot(m1, o), dot(m2, o));
            vec3 d = vec3(dot(m0.xyz, q.direction), dot(m1.xyz, q.direction), dot(m2.xyz, q.direction));
            vec3 size = abs(d);
            q.axis = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
            vec3 permuted = trace_permuted(d, q.axis);
            q.shear = vec3(permuted.xy, 1.0) / permuted.z;
            q.flags = scale.w;  // below 0 for the shared tree, whose triangles have the flags
            bool is_wanted = q.flags < 0 || ((q.flags & q.wanted) == q.wanted && (q.flags & q.rejected) == 0);
            int next = trace_stack[max(top - 1, 0)];
            bool is_last = next == TRACE_END;  // so there is no way back
            if (is_wanted) {
                q.grid_origin = (q.object_origin - intBitsToFloat(low.xyz)) * intBitsToFloat(scale.xyz);
                q.inverse = trace_inverse(d * intBitsToFloat(scale.xyz));
                q.in_mesh = true;
            }
            trace_stack[top] = TRACE_UP;
            top += is_wanted ? (is_last ? 0 : 1) : -1;
            node = is_wanted ? low.w : next;
        }
        do {
            vec3 a, b, c, d;
            int next;
            for (int k = 0; k < 2; ++k) {
                bool is_inner = uint(node) < uint(TRACE_UP);
                int row = is_inner ? node : 0;
                ivec4 low = SCENE_TREE(row), high = SCENE_TREE(row + 1);
                a = (vec3(low.xyz & 0xFFFF) - q.grid_origin) * q.inverse;
                b = (vec3(high.xyz & 0xFFFF) - q.grid_origin) * q.inverse;
                c = (vec3((low.xyz >> 16) & 0xFFFF) - q.grid_origin) * q.inverse;
                d = (vec3((high.xyz >> 16) & 0xFFFF) - q.grid_origin) * q.inverse;
                vec3 enter = min(a, b), leave = max(a, b);
                float left_enter = max(max(enter.x, enter.y), max(enter.z, q.nearest));
                float left_leave = min(min(leave.x, leave.y), min(leave.z, q.reach));
                enter = min(c, d);
                leave = max(c, d);
                float right_enter = max(max(enter.x, enter.y), max(enter.z, q.nearest));
                float right_leave = min(min(leave.x, leave.y), min(leave.z, q.reach));
                bool left = left_enter <= left_leave * 1.000001, right = right_enter <= right_leave * 1.000001;
                bool right_first = right && (!left || right_enter < left_enter);
                trace_stack[top] = right_first ? low.w : high.w;
                next = trace_stack[max(top - 1, 0)];
                next = left || right ? (right_first ? high.w : low.w) : next;
                top += !is_inner ? 0 : left && right ? 1 : left || right ? 0 : -1;
                node = is_inner ? next : node;
            }

            bool is_leaf = node < 0 && q.in_mesh;
            int leaf = is_leaf ? -1 - node : 0, at = header2.w + 3 * (leaf >> 2);
            ivec4 first = SCENE_TREE(at), second = SCENE_TREE(at + 1), third = SCENE_TREE(at + 2);
            // Triangles must compute the same numbers for a shared edge: no fused multiply-add is allowed.
            precise vec3 p0 = trace_permuted(intBitsToFloat(first.xyz) - q.object_origin, q.axis);
            precise vec3 p1 = trace_permuted(intBitsToFloat(second.xyz) - q.object_origin, q.axis);
            precise vec3 p2 = trace_permuted(intBitsToFloat(third.xyz) - q.object_origin, q.axis);
            p0.xy -= q.shear.xy * p0.z;
            p1.xy -= q.shear.xy * p1.z;
            p2.xy -= q.shear.xy * p2.z;
            precise vec3 edges =
                vec3(p2.x * p1.y - p2.y * p1.x, p0.x * p2.y - p0.y * p2.x, p1.x * p0.y - p1.y * p0.x);
            float sum = edges.x + edges.y + edges.z, over = 1.0 / sum;
            bool inside = all(greaterThanEqual(edges, vec3(0.0))) || all(lessThanEqual(edges, vec3(0.0)));
            float distance = dot(edges, vec3(p0.z, p1.z, p2.z)) * q.shear.z * over;
            int own = third.w < 0 ? q.flags : third.w;
            bool is_hit = is_leaf && inside && sum != 0.0 && distance > q.nearest && distance < q.reach
                && (own & q.wanted) == q.wanted && (own & q.rejected) == 0;
            next = trace_stack[max(top - 1, 0)];
            bool is_last = (leaf & 3) == 0;
            top -= is_leaf && is_last ? 1 : 0;
            node = !is_leaf ? node : is_last ? next : node - 3;  // a leaf of the others
            if (is_hit) {
                q.candidate = Hit(distance, third.w < 0 ? q.instance : second.w, first.w, edges.yz * over);
                stops = (own & q.asks) != 0;
                after = stops ? node : TRACE_END;
                if (!stops) {
                    q.hit = q.candidate;
                    q.reach = distance;
                }
                node = stops || q.any ? TRACE_END : node;
            }
        } while (node < TRACE_UP && (node >= 0 || q.in_mesh));
    } while (node != TRACE_END);
    q.node = after;
    q.top = top;
    return stops;
}

// The nearest hit between two distances, both exclusive, of surfaces with all flags in `wanted` and none in `rejected`;
// with `any` the first hit found.
bool trace(
    vec3 origin, vec3 direction, float nearest, float farthest, int wanted, int rejected, bool any, out Hit hit) {
    RayQuery q = ray_query(origin, direction, nearest, farthest, wanted, rejected, 0, any);
    find_candidate(q);
    hit = q.hit;
    return hit.instance >= 0;
}
