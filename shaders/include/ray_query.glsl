// Ray queries: a traversal that stops at candidates, which the caller accepts or skips. Candidates are hits of
// triangles with a flag of `asks`; all other hits are accepted at once. `trace_tree.glsl` traverses the trees over
// objects and triangles, and `rendergraph/scene/tree_data.py` describes their buffer.
#include <scene.glsl>

// An image, because llvmpipe compiles loads from images in line, but calls a function for each fetch from a sampler.
layout(rgba32i) readonly restrict uniform iimageBuffer scene_tree;
#define SCENE_TREE(row) imageLoad(scene_tree, row)

struct Hit {
    float distance;     // along the direction, in units of its length
    int instance;
    int triangle;       // number within the mesh
    vec2 barycentrics;  // weights of the second and third vertex
};

const int TRACE_UP = 0x7ffffffd;    // a node that stands for: back from a mesh to the tree over objects
const int TRACE_NONE = 0x7ffffffe;  // an empty entry of the stack
const int TRACE_END = 0x7fffffff;   // the traversal has ended
const int TRACE_ROOT = 1 << 30;     // the level of a root; a node's children are at half its level
const int TRACE_STACK = 6;

// 1 / d for each component of `d`, and a large number of its sign where it is almost 0.
vec3 trace_inverse(vec3 d) {
    vec3 least = mix(vec3(1e-30), vec3(-1e-30), lessThan(d, vec3(0.0)));
    return 1.0 / mix(d, least, lessThan(abs(d), vec3(1e-30)));
}

// The state of a query.
struct RayQuery {
    Hit hit;        // the nearest accepted hit, or with `any` the first; its instance is -1 if there is none
    Hit candidate;  // where the traversal has stopped
    vec3 origin;
    vec3 direction;
    float nearest;
    int wanted;     // flags of surfaces to hit: all of these
    int rejected;   // and none of these
    int asks;
    bool any;       // the traversal ends at the first hit that is accepted
    // State of the traversal: where it is, and the ray on the grid of the tree and in the object. `trail` has a bit for
    // each level of the path to `node`: it is set if the sibling at that level need not be visited any more.
    int node;
    int level;
    int trail;
    int leaf;                // below 0: triangles that wait to be tested
    int stack[TRACE_STACK];  // the deepest children put aside, the deepest one first
    int root;
    int after;               // the node after this tree
    int outer_level;         // of the object, in the tree over objects
    int outer_trail;
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
// A `nearest` below 0 counts as 0.
RayQuery ray_query(
    vec3 origin, vec3 direction, float nearest, float farthest, int wanted, int rejected, int asks, bool any) {
    RayQuery q;
    q.hit = q.candidate = Hit(farthest, -1, -1, vec2(0.0));
    q.origin = origin;
    q.direction = direction;
    q.nearest = max(nearest, 0.0);
    q.wanted = wanted;
    q.rejected = rejected;
    q.asks = asks;
    q.any = any;
    ivec4 header = SCENE_TREE(0), header2 = SCENE_TREE(1);
    // Helper invocations of a fragment shader may read 0 everywhere. Their rays are then NaN, which would enter every
    // box.
    bool is_ray = dot(abs(origin) + abs(direction), vec3(1.0)) < 1e30;
    q.node = header2.w > 0 && is_ray ? header.w : TRACE_END;
    q.level = TRACE_ROOT;
    q.trail = q.leaf = q.outer_level = q.outer_trail = 0;
    for (int i = 0; i < TRACE_STACK; ++i) q.stack[i] = TRACE_NONE;
    q.root = header.w;
    q.after = TRACE_END;
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
    if (q.any) {
        q.node = TRACE_END;
        q.leaf = 0;
    }
}
