// Blending weights of SMAA: searches both ends of the edge at each pixel, and looks up the area that the crossing edges
// there imply (J. Jimenez et al., "SMAA", 2012).
uniform sampler2D edges;
uniform sampler2D area_table;
uniform int reach;
uniform int side;
out vec4 weights;  // of the lower neighbour for this pixel and vice versa; the same for the left neighbour

// Whether a texel has an edge: on its left for axis 0, below it for axis 1.
bool has_edge(ivec2 texel, int axis) {
    if (texel != clamp(texel, ivec2(0), textureSize(edges, 0) - 1)) return false;
    return texelFetch(edges, texel, 0)[axis] > 0.5;
}

// The side of the crossing edge at an end: 1 up, -1 down, 0 for neither or both. `texel` is the one next to the
// crossing edge, `normal` leads from the upper to the lower pixel of the edge.
int crossing_side(ivec2 texel, ivec2 normal, int axis) {
    return int(has_edge(texel, axis)) - int(has_edge(texel + normal, axis));
}

// Both areas of a pixel at its edge towards `normal`, which runs along `tangent`.
vec2 edge_areas(ivec2 texel, ivec2 tangent, ivec2 normal, int axis) {
    int crossing_axis = 1 - axis;
    ivec2 distances = ivec2(0), crossings = ivec2(0);
    ivec2 current = texel;
    for (; distances.x < reach; ++distances.x) {
        crossings.x = crossing_side(current, normal, crossing_axis);
        bool is_crossed = has_edge(current, crossing_axis) || has_edge(current + normal, crossing_axis);
        if (is_crossed || !has_edge(current - tangent, axis)) break;
        current -= tangent;
    }
    if (distances.x == reach) crossings.x = 0;
    current = texel + tangent;
    for (; distances.y < reach; ++distances.y) {
        crossings.y = crossing_side(current, normal, crossing_axis);
        bool is_crossed = has_edge(current, crossing_axis) || has_edge(current + normal, crossing_axis);
        if (is_crossed || !has_edge(current, axis)) break;
        current += tangent;
    }
    if (distances.y == reach) crossings.y = 0;
    int pattern = 3 * (crossings.x + 1) + crossings.y + 1;
    return texelFetch(area_table, ivec2(pattern * side + distances.x, distances.y), 0).xy;
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    weights = vec4(0.0);
    if (has_edge(texel, 1)) weights.xy = edge_areas(texel, ivec2(1, 0), ivec2(0, -1), 1);
    if (has_edge(texel, 0)) weights.zw = edge_areas(texel, ivec2(0, 1), ivec2(-1, 0), 0);
}
