// The middle of a larger picture; without TEXEL it is a depth.
uniform SAMPLER source;
uniform ivec2 band;  // texels beside the middle, left and below
#ifdef TEXEL
out TEXEL cropped;
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + band;
#ifdef TEXEL
    cropped = texelFetch(source, texel, 0);
#ifdef MEANS_VELOCITY
    vec2 whole = vec2(textureSize(source, 0));
    cropped.xy *= whole / (whole - 2.0 * vec2(band));
#endif
#else
    gl_FragDepth = texelFetch(source, texel, 0).r;
#endif
}
