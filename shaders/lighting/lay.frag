// Texels as they are, for blending to lay them over or under others; the mean of their samples over a picture of one.
#if SOURCE_SAMPLES > 1
uniform sampler2DMS source;
#else
uniform sampler2D source;
#endif
out vec4 laid;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#if PASS_SAMPLES > 1
    laid = texelFetch(source, texel, gl_SampleID);
#elif SOURCE_SAMPLES > 1
    laid = vec4(0.0);
    for (int i = 0; i < SOURCE_SAMPLES; ++i) laid += texelFetch(source, texel, i) / float(SOURCE_SAMPLES);
#else
    laid = texelFetch(source, texel, 0);
#endif
}
