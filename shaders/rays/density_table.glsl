// Sampling of texels in proportion to their values (M. McCool and P. Harwood, "Probability Trees", 1997): a point of
// the unit square is warped level by level. `density_tree.frag` builds the tree from the mips of the table: a texel of
// a level holds the four values below it. Mips are read only in uniform control flow, where drivers agree on them.

// The first texel of a level, from 1, in the tree over a table of this size.
ivec2 tree_origin(ivec2 size, int level) {
    return level == 1 ? ivec2(0) : ivec2(max(size.x / 2, 1), size.y / 2 - (size.y >> (level - 1)));
}

// Levels of the tree over a table of this size; its sides are powers of two.
int tree_levels(ivec2 size) {
    return findMSB(max(size.x, size.y));
}

// The texel of the table that a point falls into; `xi` becomes the position within it.
ivec2 sample_texel(sampler2D tree, ivec2 size, inout vec2 xi) {
    ivec2 cell = ivec2(0);
    for (int level = tree_levels(size); level >= 1; --level) {
        vec4 below = texelFetch(tree, tree_origin(size, level) + cell, 0);
        float sum = below.x + below.y + below.z + below.w, lower = (below.x + below.y) / max(sum, 1e-37);
        bool is_upper = xi.y >= lower;
        xi.y = is_upper ? (xi.y - lower) / max(1.0 - lower, 1e-7) : xi.y / lower;
        vec2 row = is_upper ? below.zw : below.xy;
        float left = row.x / max(row.x + row.y, 1e-37);
        bool is_right = xi.x >= left;
        xi.x = is_right ? (xi.x - left) / max(1.0 - left, 1e-7) : xi.x / left;
        ivec2 sides = max(size >> (level - 1), 1);
        cell = min(2 * cell, sides - 1) + ivec2(is_right, is_upper) * min(sides - 1, 1);
    }
    return cell;
}

// Mean over all texels of a table.
vec4 table_mean(sampler2D table) {
    return texelFetch(table, ivec2(0), textureQueryLevels(table) - 1);
}
