// The mean of all paths so far, and its estimated variance.
uniform sampler2D mean;
uniform sampler2D spread;
#ifdef WRITES_RADIANCE
out vec4 radiance;
#endif
#ifdef WRITES_VARIANCE
out vec4 variance;
#endif
#ifdef WRITES_SAMPLES_TAKEN
out float samples_taken;
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 light = texelFetch(mean, texel, 0), sums = texelFetch(spread, texel, 0);
    float batches = sums.w;
#ifdef WRITES_RADIANCE
    radiance = light;
#endif
#ifdef WRITES_VARIANCE
    // One batch gives no estimate; the deviation is then assumed to be as large as the light itself.
    variance = vec4(batches > 1.0 ? sums.rgb / (batches * (batches - 1.0)) : light.rgb * light.rgb, 1.0);
#endif
#ifdef WRITES_SAMPLES_TAKEN
    samples_taken = batches * float(BATCH);
#endif
}
