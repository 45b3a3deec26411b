// A bitmap font of 3 × 5 pixels per glyph, with the top row in the highest three bits. The order is digits, letters,
// . - + / = _ : % ? and a blank, as in `GLYPHS` of nodes/display/_text.py.
const int GLYPHS[46] = int[](
    31599, 11415, 29671, 29647, 23497, 31183, 31215, 29257, 31727, 31695, 31725, 27566, 31015, 27502, 31143, 31140,
    31087, 23533, 29847, 4719, 23469, 18727, 24557, 27501, 31599, 31716, 31609, 27565, 31183, 29842, 23407, 23402,
    23549, 23213, 23186, 29351, 2, 448, 1488, 4772, 3640, 7, 1040, 21157, 29314, 0);
const int BLANK = 45;

// Whether a pixel of a glyph is set; pixels count from the lower left.
bool glyph_pixel(int glyph, ivec2 pixel) {
    if (any(lessThan(pixel, ivec2(0))) || pixel.x > 2 || pixel.y > 4) return false;
    return (GLYPHS[glyph] >> (pixel.y * 3 + 2 - pixel.x) & 1) == 1;
}
