// The same along rows, of what `shadow_esm_down.frag` made of columns.
uniform sampler2D columns;
uniform sampler2D covered_columns;
uniform int first_row;  // of the band that is drawn, in the map
uniform int radius;     // texels
out float filtered;
out float covered;

const float NOTHING = -1e30;  // the logarithm of no light

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(0, first_row);
    int last = textureSize(columns, 0).x - 1;
    float most = NOTHING;
    float sum = 0.0;
    covered = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(clamp(texel.x + i, 0, last), texel.y);
        float here = texelFetch(columns, other, 0).r;
        sum = here > most ? sum * exp(most - here) + 1.0 : sum + exp(here - most);
        most = max(most, here);
        covered += texelFetch(covered_columns, other, 0).r;
    }
    float taps = float(2 * radius + 1);
    filtered = most > NOTHING ? most + log(sum / taps) : NOTHING;
    covered /= taps;
}
