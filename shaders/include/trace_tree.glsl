// Rays through the trees over objects and triangles. `trace.glsl` has the questions that are asked of them, and
// `rendergraph/scene/tree_data.py` describes the buffer.
#include <scene.glsl>

layout(std430) readonly buffer scene_tree_block {
    ivec4 scene_tree[];
};

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

// The nearest hit between two distances, both exclusive, of what has all flags in `wanted` and none in `rejected`; with
// `any` the first that is found. It uses the triangle test of S. Woop, C. Benthin and I. Wald ("Watertight Ray/Triangle
// Intersection", 2013): no ray passes between two triangles that share an edge.
//
// The loops are nested so that the invocations that a processor runs in lockstep do the same work at a time. The stack
// cannot overflow: depths of trees are limited when they are built, and TRACE_STACK follows from the limits.
bool trace(
    vec3 origin, vec3 direction, float nearest, float farthest, int wanted, int rejected, bool any, out Hit hit) {
    int stack[TRACE_STACK];
    stack[0] = TRACE_END;
    int top = 1;
    ivec4 header = scene_tree[0], header2 = scene_tree[1];
    // Invocations outside a triangle that run along in a fragment shader may read 0 everywhere.
    int node = header2.w > 0 ? header.w : TRACE_END;
    vec3 top_origin = (origin - intBitsToFloat(header.xyz)) * intBitsToFloat(header2.xyz);
    vec3 top_inverse = trace_inverse(direction * intBitsToFloat(header2.xyz));
    vec3 grid_origin = top_origin, inverse = top_inverse;  // of the ray on the grid of the tree
    vec3 object_origin = vec3(0.0), shear = vec3(0.0);
    int axis = 0, instance = -1;
    bool in_mesh = false;
    hit = Hit(farthest, -1, -1, vec2(0.0));
    while (node != TRACE_END) {
        if (node == TRACE_UP) {
            in_mesh = false;
            grid_origin = top_origin;
            inverse = top_inverse;
            --top;
            node = stack[top];
        }
        if (node < 0 && !in_mesh) {  // an object
            instance = -1 - node;
            int at = 2 + 5 * instance;
            ivec4 r0 = scene_tree[at], r1 = scene_tree[at + 1], r2 = scene_tree[at + 2];
            ivec4 low = scene_tree[at + 3], scale = scene_tree[at + 4];
            vec4 m0 = intBitsToFloat(r0), m1 = intBitsToFloat(r1), m2 = intBitsToFloat(r2), o = vec4(origin, 1.0);
            object_origin = vec3(dot(m0, o), dot(m1, o), dot(m2, o));
            vec3 d = vec3(dot(m0.xyz, direction), dot(m1.xyz, direction), dot(m2.xyz, direction));
            vec3 size = abs(d);
            axis = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
            vec3 permuted = trace_permuted(d, axis);
            shear = vec3(permuted.xy, 1.0) / permuted.z;
            bool is_wanted = (scale.w & wanted) == wanted && (scale.w & rejected) == 0;
            if (is_wanted) {
                grid_origin = (object_origin - intBitsToFloat(low.xyz)) * intBitsToFloat(scale.xyz);
                inverse = trace_inverse(d * intBitsToFloat(scale.xyz));
                in_mesh = true;
                stack[top] = TRACE_UP;
                ++top;
                node = low.w;
            } else {
                --top;
                node = stack[top];
            }
        }
        do {
            while (uint(node) < uint(TRACE_UP)) {
                ivec4 low = scene_tree[node], high = scene_tree[node + 1];
                vec3 a = (vec3(low.xyz & 0xFFFF) - grid_origin) * inverse;
                vec3 b = (vec3(high.xyz & 0xFFFF) - grid_origin) * inverse;
                vec3 c = (vec3((low.xyz >> 16) & 0xFFFF) - grid_origin) * inverse;
                vec3 d = (vec3((high.xyz >> 16) & 0xFFFF) - grid_origin) * inverse;
                vec3 enter = min(a, b), leave = max(a, b);
                float left_enter = max(max(enter.x, enter.y), max(enter.z, nearest));
                float left_leave = min(min(leave.x, leave.y), min(leave.z, hit.distance));
                enter = min(c, d);
                leave = max(c, d);
                float right_enter = max(max(enter.x, enter.y), max(enter.z, nearest));
                float right_leave = min(min(leave.x, leave.y), min(leave.z, hit.distance));
                bool left = left_enter <= left_leave * 1.000001, right = right_enter <= right_leave * 1.000001;
                bool right_first = right && (!left || right_enter < left_enter);
                stack[top] = right_first ? low.w : high.w;
                top += left && right ? 1 : left || right ? 0 : -1;
                node = left || right ? (right_first ? high.w : low.w) : stack[top];
            }
            bool is_leaf = node < 0 && in_mesh;
            int at = header2.w + 3 * ((-1 - node) >> 2), last = is_leaf ? at + 3 * ((-1 - node) & 3) : at - 1;
            for (; at <= last; at += 3) {
                ivec4 first = scene_tree[at], second = scene_tree[at + 1], third = scene_tree[at + 2];
                // Triangles must compute the same numbers for a shared edge: no fused multiply-add may come in.
                precise vec3 a = trace_permuted(intBitsToFloat(first.xyz) - object_origin, axis);
                precise vec3 b = trace_permuted(intBitsToFloat(second.xyz) - object_origin, axis);
                precise vec3 c = trace_permuted(intBitsToFloat(third.xyz) - object_origin, axis);
                a.xy -= shear.xy * a.z;
                b.xy -= shear.xy * b.z;
                c.xy -= shear.xy * c.z;
                precise vec3 edges = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
                float sum = edges.x + edges.y + edges.z;
                bool inside = all(greaterThanEqual(edges, vec3(0.0))) || all(lessThanEqual(edges, vec3(0.0)));
                float distance = dot(edges, vec3(a.z, b.z, c.z)) * shear.z / sum;
                if (inside && sum != 0.0 && distance > nearest && distance < hit.distance) {
                    hit = Hit(distance, instance, first.w, edges.yz / sum);
                    if (any) return true;
                }
            }
            if (is_leaf) {
                --top;
                node = stack[top];
            }
        } while (node < TRACE_UP && (node >= 0 || in_mesh));
    }
    return hit.instance >= 0;
}
