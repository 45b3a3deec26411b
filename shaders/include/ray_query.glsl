// Ray queries: a traversal that stops at candidates, which the caller accepts or skips. Candidates are hits of
// triangles with a flag of `asks`; all other hits are accepted at once. `trace_tree.glsl` traverses the trees over
// objects and triangles, and `rendergraph/scene/tree_data.py` describes their buffer.
#include <scene.glsl>

uniform isamplerBuffer scene_tree;
#define SCENE_TREE(row) texelFetch(scene_tree, row)

struct Hit {
    float distance;     // along the direction, in units of its length
    int instance;
    int triangle;       // number within the mesh
    vec2 barycentrics;  // weights of the second and third vertex
};

const int TRACE_UP = 0x7ffffffe;   // on the stack: back from a mesh to the tree over objects
const int TRACE_END = 0x7fffffff;  // the traversal has ended

// 1 / d for each component of `d`, and a large number of its sign where it is almost 0.
vec3 trace_inverse(vec3 d) {
    vec3 least = mix(vec3(1e-30), vec3(-1e-30), lessThan(d, vec3(0.0)));
    return 1.0 / mix(d, least, lessThan(abs(d), vec3(1e-30)));
}

int trace_stack[TRACE_STACK];  // of the current query; in a structure it would be copied with each call

// The state of a query. An invocation can have one at a time.
struct RayQuery {
    Hit hit;        // the nearest accepted hit, or with `any` the first; its instance is -1 if there is none
    Hit candidate;  // where the traversal has stopped
    vec3 origin;
    vec3 direction;
    float nearest;
    float reach;    // hits farther away are ignored
    int wanted;     // flags of surfaces to hit: all of these
    int rejected;   // and none of these
    int asks;
    bool any;       // the traversal ends at the first hit that is accepted
    // State of the traversal: the node, the top of the stack, and the ray on the grid of the tree and in the object.
    int node;
    int top;
    bool in_mesh;
    vec3 grid_origin;
    vec3 inverse;
    vec3 object_origin;
    vec3 shear;
    int axis;
    int instance;
    int flags;
};

// A query from `origin` along `direction` between the distances `nearest` and `farthest`, both exclusive, for surfaces
// with all flags in `wanted` and none in `rejected`. It stops at flags of `asks`; with `any` it ends at the first hit.
RayQuery ray_query(
    vec3 origin, vec3 direction, float nearest, float farthest, int wanted, int rejected, int asks, bool any) {
    RayQuery q;
    q.hit = q.candidate = Hit(farthest, -1, -1, vec2(0.0));
    q.origin = origin;
    q.direction = direction;
    q.nearest = nearest;
    q.reach = farthest;
    q.wanted = wanted;
    q.rejected = rejected;
    q.asks = asks;
    q.any = any;
    ivec4 header = SCENE_TREE(0), header2 = SCENE_TREE(1);
    // Helper invocations of a fragment shader may read 0 everywhere. Their rays are then NaN, which would enter every
    // box.
    bool is_ray = dot(abs(origin) + abs(direction), vec3(1.0)) < 1e30;
    q.node = header2.w > 0 && is_ray ? header.w : TRACE_END;
    trace_stack[0] = TRACE_END;
    q.top = 1;
    q.in_mesh = false;
    q.grid_origin = (origin - intBitsToFloat(header.xyz)) * intBitsToFloat(header2.xyz);
    q.inverse = trace_inverse(direction * intBitsToFloat(header2.xyz));
    q.object_origin = q.shear = vec3(0.0);
    q.axis = q.flags = 0;
    q.instance = -1;
    return q;
}

// Accepts the candidate of the query `q`.
void accept_candidate(inout RayQuery q) {
    q.hit = q.candidate;
    q.reach = q.candidate.distance;
    if (q.any) q.node = TRACE_END;
}
