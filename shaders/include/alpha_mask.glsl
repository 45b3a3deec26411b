// Alpha masking.

// Discards this fragment where its alpha is below the `cutoff`. With multisampling, alpha is extrapolated linearly to
// each sample position (alpha to coverage), so that the edges of the mask are antialiased.
void alpha_test(float alpha, float cutoff) {
#if PASS_SAMPLES > 1
    vec2 gradient = vec2(dFdx(alpha), dFdy(alpha));
    int coverage = 0;
    for (int i = 0; i < PASS_SAMPLES; ++i) {
        if (alpha + dot(gradient, PASS_SAMPLE_POSITIONS[i] - 0.5) >= cutoff) coverage |= 1 << i;
    }
    if (coverage == 0) discard;
    gl_SampleMask[0] = coverage;
#else
    if (alpha < cutoff) discard;
#endif
}
