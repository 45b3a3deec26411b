// Rays through the trees over objects and triangles. `trace.glsl` has the questions that are asked of them, and
// `rendergraph/scene/tree_data.py` describes the buffer.
#include <scene.glsl>

uniform isamplerBuffer scene_tree;
#define SCENE_TREE(row) texelFetch(scene_tree, row)

struct Hit {
    float distance;     // along the direction, in its lengths
    int instance;
    int triangle;       // number within the mesh
    vec2 barycentrics;  // weights of the second and third vertex
};

const int TRACE_UP = 0x7ffffffe;   // on the stack: back from a mesh to the tree over objects
const int TRACE_END = 0x7fffffff;  // nothing is left

// 1 / d for each component of `d`, and a large number of its sign where it is almost 0.
vec3 trace_inverse(vec3 d) {
    vec3 least = mix(vec3(1e-30), vec3(-1e-30), lessThan(d, vec3(0.0)));
    return 1.0 / mix(d, least, lessThan(abs(d), vec3(1e-30)));
}

// The axes in an order that ends with `last`, without mirroring.
vec3 trace_permuted(vec3 v, int last) {
    return last == 2 ? v : last == 0 ? v.yzx : v.zxy;
}

// The nearest hit between two distances, both exclusive, of what has all flags in `wanted` and none in `rejected`. With
// `any` the search ends at the first hit that is found: `ends` is then true, unless it has a flag of `passing`; of
// those the nearest is the hit. The triangle test is that of S. Woop, C. Benthin and I. Wald ("Watertight Ray/Triangle
// Intersection", 2013): no ray passes between two triangles that share an edge.
//
// Each turn of the inner loop visits two nodes and tests a triangle, and invocations leave it only when nothing is left
// of the tree. Those that a processor runs in lockstep then do the same work most of the time, and the set of those
// that are active seldom changes, which llvmpipe's branches can predict. The stack cannot overflow: depths of trees are
// limited when they are built, and TRACE_STACK follows from the limits.
bool trace(
    vec3 origin, vec3 direction, float nearest, float farthest, int wanted, int rejected, bool any, int passing,
    out Hit hit, out bool ends) {
    int stack[TRACE_STACK];
    stack[0] = TRACE_END;
    int top = 1;
    ivec4 header = SCENE_TREE(0), header2 = SCENE_TREE(1);
    // Invocations outside a triangle that run along in a fragment shader may read 0 everywhere, and then their rays are
    // not numbers, which enter every box.
    bool is_ray = dot(abs(origin) + abs(direction), vec3(1.0)) < 1e30;
    int node = header2.w > 0 && is_ray ? header.w : TRACE_END;
    vec3 top_origin = (origin - intBitsToFloat(header.xyz)) * intBitsToFloat(header2.xyz);
    vec3 top_inverse = trace_inverse(direction * intBitsToFloat(header2.xyz));
    vec3 grid_origin = top_origin, inverse = top_inverse;  // of the ray on the grid of the tree
    vec3 object_origin = vec3(0.0), shear = vec3(0.0);
    int axis = 0, instance = -1, flags = 0;
    bool in_mesh = false;
    float reach = farthest;
    ends = false;
    hit = Hit(farthest, -1, -1, vec2(0.0));
    do {
        bool goes_up = node == TRACE_UP;
        if (goes_up) {
            in_mesh = false;
            grid_origin = top_origin;
            inverse = top_inverse;
            --top;
            node = stack[top];
        }
        if (node < 0 && !in_mesh) {  // an object
            instance = -1 - node;
            int at = 2 + 5 * instance;
            ivec4 r0 = SCENE_TREE(at), r1 = SCENE_TREE(at + 1), r2 = SCENE_TREE(at + 2);
            ivec4 low = SCENE_TREE(at + 3), scale = SCENE_TREE(at + 4);
            vec4 m0 = intBitsToFloat(r0), m1 = intBitsToFloat(r1), m2 = intBitsToFloat(r2), o = vec4(origin, 1.0);
            object_origin = vec3(dot(m0, o), dot(m1, o), dot(m2, o));
            vec3 d = vec3(dot(m0.xyz, direction), dot(m1.xyz, direction), dot(m2.xyz, direction));
            vec3 size = abs(d);
            axis = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
            vec3 permuted = trace_permuted(d, axis);
            shear = vec3(permuted.xy, 1.0) / permuted.z;
            flags = scale.w;  // below 0 for the shared tree, whose triangles have them
            bool is_wanted = flags < 0 || ((flags & wanted) == wanted && (flags & rejected) == 0);
            int next = stack[max(top - 1, 0)];
            bool is_last = next == TRACE_END;  // so there is no way back
            if (is_wanted) {
                grid_origin = (object_origin - intBitsToFloat(low.xyz)) * intBitsToFloat(scale.xyz);
                inverse = trace_inverse(d * intBitsToFloat(scale.xyz));
                in_mesh = true;
            }
            stack[top] = TRACE_UP;
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
                a = (vec3(low.xyz & 0xFFFF) - grid_origin) * inverse;
                b = (vec3(high.xyz & 0xFFFF) - grid_origin) * inverse;
                c = (vec3((low.xyz >> 16) & 0xFFFF) - grid_origin) * inverse;
                d = (vec3((high.xyz >> 16) & 0xFFFF) - grid_origin) * inverse;
                vec3 enter = min(a, b), leave = max(a, b);
                float left_enter = max(max(enter.x, enter.y), max(enter.z, nearest));
                float left_leave = min(min(leave.x, leave.y), min(leave.z, reach));
                enter = min(c, d);
                leave = max(c, d);
                float right_enter = max(max(enter.x, enter.y), max(enter.z, nearest));
                float right_leave = min(min(leave.x, leave.y), min(leave.z, reach));
                bool left = left_enter <= left_leave * 1.000001, right = right_enter <= right_leave * 1.000001;
                bool right_first = right && (!left || right_enter < left_enter);
                stack[top] = right_first ? low.w : high.w;
                next = stack[max(top - 1, 0)];
                next = left || right ? (right_first ? high.w : low.w) : next;
                top += !is_inner ? 0 : left && right ? 1 : left || right ? 0 : -1;
                node = is_inner ? next : node;
            }

            bool is_leaf = node < 0 && in_mesh;
            int leaf = is_leaf ? -1 - node : 0, at = header2.w + 3 * (leaf >> 2);
            ivec4 first = SCENE_TREE(at), second = SCENE_TREE(at + 1), third = SCENE_TREE(at + 2);
            // Triangles must compute the same numbers for a shared edge: no fused multiply-add may come in.
            precise vec3 p = trace_permuted(intBitsToFloat(first.xyz) - object_origin, axis);
            precise vec3 q = trace_permuted(intBitsToFloat(second.xyz) - object_origin, axis);
            precise vec3 r = trace_permuted(intBitsToFloat(third.xyz) - object_origin, axis);
            p.xy -= shear.xy * p.z;
            q.xy -= shear.xy * q.z;
            r.xy -= shear.xy * r.z;
            precise vec3 edges = vec3(r.x * q.y - r.y * q.x, p.x * r.y - p.y * r.x, q.x * p.y - q.y * p.x);
            float sum = edges.x + edges.y + edges.z, over = 1.0 / sum;
            bool inside = all(greaterThanEqual(edges, vec3(0.0))) || all(lessThanEqual(edges, vec3(0.0)));
            float distance = dot(edges, vec3(p.z, q.z, r.z)) * shear.z * over;
            int own = third.w < 0 ? flags : third.w;
            bool is_hit = is_leaf && inside && sum != 0.0 && distance > nearest && distance < hit.distance
                && (own & wanted) == wanted && (own & rejected) == 0;
            next = stack[max(top - 1, 0)];
            bool is_last = (leaf & 3) == 0;
            top -= is_leaf && is_last ? 1 : 0;
            node = !is_leaf ? node : is_last ? next : node - 3;  // a leaf of the others
            if (is_hit) {
                hit = Hit(distance, third.w < 0 ? instance : second.w, first.w, edges.yz * over);
                ends = any && (own & passing) == 0;
                node = ends ? TRACE_END : node;
                reach = any ? reach : distance;
            }
        } while (node < TRACE_UP && (node >= 0 || in_mesh));
    } while (node != TRACE_END);
    return hit.instance >= 0;
}

// The same without anything that lets light pass; `any` ends the search at the first hit.
bool trace(
    vec3 origin, vec3 direction, float nearest, float farthest, int wanted, int rejected, bool any, out Hit hit) {
    bool ends;
    return trace(origin, direction, nearest, farthest, wanted, rejected, any, 0, hit, ends);
}
