// The second axis of the filter over what a technique keeps of a shadow map: averages along rows.
uniform sampler2D columns;
#ifdef WRITES_COVERED
uniform sampler2D covered_columns;
out float covered;
#endif
uniform int first_row;  // of the band that is drawn, in the map
uniform int radius;     // texels
out vec4 filtered;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(0, first_row);
    int last = textureSize(columns, 0).x - 1;
    filtered = vec4(0.0);
    float sum = 0.0;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 other = ivec2(clamp(texel.x + i, 0, last), texel.y);
        filtered += texelFetch(columns, other, 0);
#ifdef WRITES_COVERED
        sum += texelFetch(covered_columns, other, 0).r;
#endif
    }
    float taps = float(2 * radius + 1);
    filtered /= taps;
#ifdef WRITES_COVERED
    covered = sum / taps;
#endif
}
