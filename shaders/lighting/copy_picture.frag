// A copy of the picture so far: the mean of its samples.
#if RADIANCE_SAMPLES > 1
uniform sampler2DMS radiance;
#else
uniform sampler2D radiance;
#endif
out vec4 behind;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    behind = texelFetch(radiance, texel, 0);
#if RADIANCE_SAMPLES > 1
    for (int i = 1; i < RADIANCE_SAMPLES; ++i) behind += texelFetch(radiance, texel, i);
    behind /= float(RADIANCE_SAMPLES);
#endif
}
