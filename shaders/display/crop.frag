// The centre of a larger picture. Without TEXEL, the picture is a depth texture.
uniform SAMPLER source;
uniform ivec2 band;  // width of the border on the left and at the bottom, in texels
#ifdef TEXEL
out TEXEL cropped;
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) + band;
#ifdef TEXEL
    cropped = texelFetch(source, texel, 0);
#ifdef MEANS_VELOCITY
    vec2 source_size = vec2(textureSize(source, 0));
    cropped.xy *= source_size / (source_size - 2.0 * vec2(band));
#endif
#else
    gl_FragDepth = texelFetch(source, texel, 0).r;
#endif
}
