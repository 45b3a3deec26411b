// The same along columns, of what `shadow_esm_across.frag` made of rows.
uniform sampler2D rows;
uniform sampler2D covered_rows;
uniform int radius;  // texels
out float filtered;
out float covered;

const float NOTHING = -1e30;  // the logarithm of no light

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int last = textureSize(rows, 0).y - 1;
    float most = NOTHING;
    float sum = 0.0;
    covered = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(texel.x, clamp(texel.y + i, 0, last));
        float here = texelFetch(rows, other, 0).r;
        sum = here > most ? sum * exp(most - here) + 1.0 : sum + exp(here - most);
        most = max(most, here);
        covered += texelFetch(covered_rows, other, 0).r;
    }
    float taps = float(2 * radius + 1);
    filtered = most > NOTHING ? most + log(sum / taps) : NOTHING;
    covered /= taps;
}
