// Traversal of the trees over objects and triangles. `trace.glsl` has the queries for shaders to call.
#include <trace_triangle.glsl>

// If `ends`, leaves the subtree of `q.node` for the deepest child that was put aside. If `pushes`, puts the child
// `pushed` aside.
void trace_next(inout RayQuery q, bool ends, bool pushes, int pushed) {
    // Adding 1 at the level clears levels that are finished, and sets the bit of the lowest one with a child put aside.
    int trail = (q.trail & -q.level) + q.level;
    bool is_done = trail >= TRACE_ROOT, is_lost = q.stack[0] == TRACE_NONE;
    q.node = ends ? (is_done ? q.after : is_lost ? q.root : q.stack[0]) : q.node;
    q.trail = ends ? trail : q.trail;
    q.level = ends ? (is_lost ? TRACE_ROOT : trail & -trail) : q.level;
    for (int i = 0; i < TRACE_STACK; ++i) {
        int entry = q.stack[i], below = i + 1 < TRACE_STACK ? q.stack[i + 1] : TRACE_NONE;
        q.stack[i] = pushes ? pushed : ends && !is_done ? below : entry;
        pushed = entry;
    }
}

// Visits an inner node of the tree: goes on to its nearer child that the ray hits before `reach`. Distances are
// compared as integers, which takes a third of the operations on llvmpipe. Those below 0 are then in the wrong order
// among themselves, but are less than `q.nearest` in any case.
void trace_visit(inout RayQuery q, float reach) {
    bool is_inner = uint(q.node) < uint(TRACE_UP);
    ivec4 low = SCENE_TREE(q.node), high = SCENE_TREE(q.node + 1);  // used only if `is_inner`
    ivec3 a = floatBitsToInt((vec3(low.xyz & 0xFFFF) - q.grid_origin) * q.inverse);
    ivec3 b = floatBitsToInt((vec3(high.xyz & 0xFFFF) - q.grid_origin) * q.inverse);
    ivec3 c = floatBitsToInt((vec3((low.xyz >> 16) & 0xFFFF) - q.grid_origin) * q.inverse);
    ivec3 d = floatBitsToInt((vec3((high.xyz >> 16) & 0xFFFF) - q.grid_origin) * q.inverse);
    int begin = floatBitsToInt(q.nearest), end = floatBitsToInt(reach);
    const int ROUNDING = 12;  // steps of a float's precision
    ivec3 enter = min(a, b), leave = max(a, b);
    int left_enter = max(max(enter.x, enter.y), max(enter.z, begin));
    bool left = left_enter <= min(min(leave.x, leave.y), min(leave.z, end)) + ROUNDING;
    enter = min(c, d);
    leave = max(c, d);
    int right_enter = max(max(enter.x, enter.y), max(enter.z, begin));
    bool right = right_enter <= min(min(leave.x, leave.y), min(leave.z, end)) + ROUNDING;

    bool both = left && right, right_first = right && (!left || right_enter < left_enter);
    // After a restart, `trail` still has bits below the level. They lead to the child that the stack has lost, which is
    // at the lowest bit.
    int child_level = q.level >> 1, ahead = q.trail & (q.level - 1);
    bool is_first = ahead < child_level;  // the farther child is still to be visited
    bool ends = is_inner && !both && (!(left || right) || ahead == child_level);
    bool descends = is_inner && !ends;
    int nearer = right_first ? high.w : low.w, farther = right_first ? low.w : high.w;
    q.node = descends ? (both && !is_first ? farther : nearer) : q.node;
    trace_next(q, ends, descends && both && is_first, farther);
    q.trail |= descends && !both ? child_level : 0;
    q.level = descends ? child_level : q.level;
}

// Goes from the tree over objects into that of the object `q.node`, if its flags are those that the query wants.
void trace_enter(inout RayQuery q) {
    q.instance = -1 - q.node;
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
    q.outer_level = q.level;
    q.outer_trail = q.trail;
    q.after = (q.trail & -q.level) + q.level >= TRACE_ROOT ? TRACE_END : TRACE_UP;  // no way back from the last one
    q.node = is_wanted ? low.w : q.after;
    if (is_wanted) {
        q.grid_origin = (q.object_origin - intBitsToFloat(low.xyz)) * intBitsToFloat(scale.xyz);
        q.inverse = trace_inverse(d * intBitsToFloat(scale.xyz));
        q.in_mesh = true;
        q.root = low.w;
        q.trail = 0;
        q.level = TRACE_ROOT;
    }
}

// Whether the query `q` has something to do in its current tree.
bool trace_has_work(RayQuery q) {
    return q.leaf < 0 || (q.node < TRACE_UP && (q.node >= 0 || q.in_mesh));
}

// Continues the query `q`: true where it has stopped at a candidate, false where it has ended.
//
// The stack is so short that it fits into registers, because elements of arrays are slow to address on llvmpipe. Where
// more children remain than it holds, the traversal restarts at the root, and a bit per level says which way to take
// (S. Laine, "Restart Trail for Stackless BVH Traversal", 2010). This needs no more than 30 levels.
//
// Each iteration of the inner loop tests a triangle and visits three nodes, and invocations leave it only at candidates
// and at the end of the tree. A leaf waits for the next iteration while the traversal goes on (T. Aila and S. Laine,
// "Understanding the Efficiency of Ray Traversal on GPUs", 2009). Invocations that run in lockstep then do the same
// work most of the time.
bool find_candidate(inout RayQuery q) {
    ivec4 header = SCENE_TREE(0), header2 = SCENE_TREE(1);
    vec3 top_origin = (q.origin - intBitsToFloat(header.xyz)) * intBitsToFloat(header2.xyz);
    vec3 top_inverse = trace_inverse(q.direction * intBitsToFloat(header2.xyz));
    bool stops = false;
    do {
        if (q.node == TRACE_UP && q.leaf == 0) {
            q.in_mesh = false;
            q.grid_origin = top_origin;
            q.inverse = top_inverse;
            q.root = header.w;
            q.after = TRACE_END;
            q.level = q.outer_level;
            q.trail = q.outer_trail;
            trace_next(q, true, false, 0);
        }
        if (q.node < 0 && !q.in_mesh) trace_enter(q);
        do {
            // Without this condition nothing below would act, either. But for invocations that have left the loop,
            // llvmpipe computes all values again that are not assigned in a branch.
            if (!stops && trace_has_work(q)) {
                bool is_leaf = q.node < 0 && q.in_mesh && q.leaf == 0;
                q.leaf = is_leaf ? q.node : q.leaf;
                trace_next(q, is_leaf, false, 0);
                float reach = q.hit.distance;  // before the test, so that processors do both at the same time
                stops = trace_triangle(q, header2.w);
                for (int i = 0; i < 3; ++i) trace_visit(q, reach);
            }
        } while (!stops && trace_has_work(q));
    } while (!stops && q.node != TRACE_END);
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
