// The second axis of the filter over what a technique keeps of a shadow map: averages along columns.
uniform sampler2D rows;
#ifdef WRITES_COVERED
uniform sampler2D covered_rows;
out float covered;
#endif
uniform int radius;  // texels
out vec4 filtered;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int last = textureSize(rows, 0).y - 1;
    filtered = vec4(0.0);
    float sum = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(texel.x, clamp(texel.y + i, 0, last));
        filtered += texelFetch(rows, other, 0);
#ifdef WRITES_COVERED
        sum += texelFetch(covered_rows, other, 0).r;
#endif
    }
    float taps = float(2 * radius + 1);
    filtered /= taps;
#ifdef WRITES_COVERED
    covered = sum / taps;
#endif
}
