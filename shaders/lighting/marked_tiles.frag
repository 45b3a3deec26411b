// Whether any texel of a tile is marked.
uniform sampler2D edges;
out float tiles;

void main() {
    ivec2 first = ivec2(gl_FragCoord.xy) * TILE;
    ivec2 end = min(first + TILE, textureSize(edges, 0));
    tiles = 0.0;
    for (int y = first.y; y < end.y; ++y) {
        for (int x = first.x; x < end.x; ++x) tiles = max(tiles, texelFetch(edges, ivec2(x, y), 0).r);
    }
}
