// The fastest motion that may reach into a tile: that of the tile itself and of its neighbours. Those at its corners
// count only if their motion points along the diagonal towards it (Guertin, McGuire and Nowrouzezahrai 2014).
uniform sampler2D source;
out vec2 longest;

void main() {
    ivec2 tile = ivec2(gl_FragCoord.xy), last = textureSize(source, 0) - 1;
    longest = texelFetch(source, tile, 0).xy;
    for (int i = 0; i < 9; ++i) {
        ivec2 offset = ivec2(i % 3, i / 3) - 1;
        vec2 other = texelFetch(source, clamp(tile + offset, ivec2(0), last), 0).xy;
        bool is_corner = offset.x != 0 && offset.y != 0;
        bool points_away = is_corner && other.x * other.y * float(offset.x * offset.y) < 0.0;
        if (!points_away && dot(other, other) > dot(longest, longest)) longest = other;
    }
}
