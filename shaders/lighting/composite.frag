// Copies texels, for blending them over or under another picture. Samples are averaged if the target has only one.
#if SOURCE_SAMPLES > 1
uniform sampler2DMS source;
#else
uniform sampler2D source;
#endif
out vec4 color;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#if PASS_SAMPLES > 1
    color = texelFetch(source, texel, gl_SampleID);
#elif SOURCE_SAMPLES > 1
    color = vec4(0.0);
    for (int i = 0; i < SOURCE_SAMPLES; ++i) color += texelFetch(source, texel, i) / float(SOURCE_SAMPLES);
#else
    color = texelFetch(source, texel, 0);
#endif
}
