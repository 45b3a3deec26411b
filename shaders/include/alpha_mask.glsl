// What an alpha mask leaves of a fragment. With several samples a texel each is asked, by alpha as it runs on straight
// from here: alpha to coverage, with edges where the mask has them instead of a pattern.
void alpha_test(float alpha, float cutoff) {
#if PASS_SAMPLES > 1
    vec2 slope = vec2(dFdx(alpha), dFdy(alpha));
    int covered = 0;
    for (int i = 0; i < PASS_SAMPLES; ++i) {
        if (alpha + dot(slope, PASS_SAMPLE_POSITIONS[i] - 0.5) >= cutoff) covered |= 1 << i;
    }
    if (covered == 0) discard;
    gl_SampleMask[0] = covered;
#else
    if (alpha < cutoff) discard;
#endif
}
