// A square over each tile of the picture that holds a mark, two triangles each; the others have no area.
uniform sampler2D tiles;
uniform ivec2 screen;

void main() {
    int number = gl_VertexID / 6;
    int corner = int[](0, 1, 2, 2, 1, 3)[gl_VertexID % 6];
    int columns = textureSize(tiles, 0).x;
    ivec2 tile = ivec2(number % columns, number / columns);
    bool marked = texelFetch(tiles, tile, 0).r > 0.5;
    vec2 place = vec2((tile + ivec2(corner & 1, corner >> 1)) * TILE) / vec2(screen);
    gl_Position = marked ? vec4(place * 2.0 - 1.0, 0.0, 1.0) : vec4(0.0, 0.0, 0.0, 1.0);
}
