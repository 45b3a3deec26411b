// A tree over the values of a table: each texel has the four values of the level below.
#include "density_table.glsl"
uniform sampler2D table;
uniform int channel;
out vec4 tree;

void main() {
    ivec2 size = textureSize(table, 0), texel = ivec2(gl_FragCoord.xy);
    tree = vec4(0.0);
    for (int level = 1; level <= tree_levels(size); ++level) {
        ivec2 sides = max(size >> level, 1), below = max(size >> (level - 1), 1);
        ivec2 cell = texel - tree_origin(size, level), first = min(2 * cell, below - 1);
        ivec2 last = min(first + 1, below - 1);
        vec4 found = vec4(
            texelFetch(table, first, level - 1)[channel],
            texelFetch(table, ivec2(last.x, first.y), level - 1)[channel],
            texelFetch(table, ivec2(first.x, last.y), level - 1)[channel],
            texelFetch(table, last, level - 1)[channel]);
        // A side of one texel has no texel on the right, or above.
        if (below.x == 1) found.yw = vec2(0.0);
        if (below.y == 1) found.zw = vec2(0.0);
        bool is_inside = all(greaterThanEqual(cell, ivec2(0))) && all(lessThan(cell, sides));
        tree = is_inside ? found : tree;
    }
}
