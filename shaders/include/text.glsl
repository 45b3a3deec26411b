// Characters of 3 by 5 dots, the top row in the highest three bits: digits, letters, . - + / = _ : % ? and a blank, in
// this order (`GLYPHS` of nodes/display/_text.py).
const int GLYPHS[46] = int[](
    31599, 11415, 29671, 29647, 23497, 31183, 31215, 29257, 31727, 31695, 31725, 27566, 31015, 27502, 31143, 31140,
    31087, 23533, 29847, 4719, 23469, 18727, 24557, 27501, 31599, 31716, 31609, 27565, 31183, 29842, 23407, 23402,
    23549, 23213, 23186, 29351, 2, 448, 1488, 4772, 3640, 7, 1040, 21157, 29314, 0);
const int BLANK = 45;

// Whether a dot of a character is set; dots count from the lower left.
bool glyph_pixel(int character, ivec2 at) {
    if (any(lessThan(at, ivec2(0))) || at.x > 2 || at.y > 4) return false;
    return (GLYPHS[character] >> (at.y * 3 + 2 - at.x) & 1) == 1;
}
