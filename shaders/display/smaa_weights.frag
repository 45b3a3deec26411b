// How much each pixel at an edge takes of the pixel across it: the edge is followed to both ends, and what crosses
// there says which line it stands for (J. Jimenez et al., "SMAA", 2012).
uniform sampler2D edges;
uniform sampler2D areas;
uniform int reach;
uniform int side;
out vec4 weights;  // this of the one below, the one below of this; this of the one on the left, that of this

// Whether there is an edge on the near side of a texel along an axis: its left where that is x, its bottom where y.
bool edge(ivec2 texel, int axis) {
    if (texel != clamp(texel, ivec2(0), textureSize(edges, 0) - 1)) return false;
    return texelFetch(edges, texel, 0)[axis] > 0.5;
}

// What goes on at the end of an edge on a side: up 1, down -1, neither or both 0. `at` is the first texel beyond where
// the crossing edge is the near side of it, `across` the way from the edge's upper to its lower pixel.
int crossing(ivec2 at, ivec2 across, int axis) {
    return int(edge(at, axis)) - int(edge(at + across, axis));
}

// Both areas at the pixel's edge towards `across`, which runs along `along`.
vec2 areas_at(ivec2 texel, ivec2 along, ivec2 across, int axis) {
    int other = 1 - axis;
    ivec2 ways = ivec2(0), ends = ivec2(0);
    ivec2 last = texel;
    for (; ways.x < reach; ++ways.x) {
        ends.x = crossing(last, across, other);
        bool crossed = edge(last, other) || edge(last + across, other);
        if (crossed || !edge(last - along, axis)) break;
        last -= along;
    }
    if (ways.x == reach) ends.x = 0;
    last = texel + along;
    for (; ways.y < reach; ++ways.y) {
        ends.y = crossing(last, across, other);
        bool crossed = edge(last, other) || edge(last + across, other);
        if (crossed || !edge(last, axis)) break;
        last += along;
    }
    if (ways.y == reach) ends.y = 0;
    int shape = 3 * (ends.x + 1) + ends.y + 1;
    return texelFetch(areas, ivec2(shape * side + ways.x, ways.y), 0).xy;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    weights = vec4(0.0);
    if (edge(texel, 1)) weights.xy = areas_at(texel, ivec2(1, 0), ivec2(0, -1), 1);
    if (edge(texel, 0)) weights.zw = areas_at(texel, ivec2(0, 1), ivec2(-1, 0), 0);
}
