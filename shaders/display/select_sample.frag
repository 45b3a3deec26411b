// One sample of each texel. Without TEXEL, the texture is a depth texture.
uniform SAMPLER source;
#ifdef TEXEL
out TEXEL chosen;
#endif

void main() {
#ifdef TEXEL
    chosen = texelFetch(source, ivec2(gl_FragCoord.xy), SAMPLE_NUMBER);
#else
    gl_FragDepth = texelFetch(source, ivec2(gl_FragCoord.xy), SAMPLE_NUMBER).r;
#endif
}
