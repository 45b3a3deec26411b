// One sample of each texel; without TEXEL it is a depth.
uniform SAMPLER source;
#ifdef TEXEL
out TEXEL chosen;
#endif

void main() {
#ifdef TEXEL
    chosen = texelFetch(source, ivec2(gl_FragCoord.xy), INDEX);
#else
    gl_FragDepth = texelFetch(source, ivec2(gl_FragCoord.xy), INDEX).r;
#endif
}
