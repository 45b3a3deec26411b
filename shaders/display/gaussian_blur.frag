// One axis of a Gaussian blur: 2 radius + 1 taps at texel centres, normalised. Each weight follows from the one before
// by two multiplications (K. Turkowski, "Incremental Computation of the Gaussian", GPU Gems 3, 2007).
uniform sampler2D source;
uniform ivec2 axis;    // (1, 0) or (0, 1)
uniform int radius;    // texels, three standard deviations
out vec4 blurred;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(source, 0) - 1;
    float sigma = max(float(radius), 1.0) / 3.0;
    float ratio = exp(-0.5 / (sigma * sigma));
    float ratio_change = ratio * ratio;
    float weight = 1.0;
    float total_weight = 1.0;
    vec4 sum = texelFetch(source, texel, 0);
    for (int i = 1; i <= radius; ++i) {
        weight *= ratio;
        ratio *= ratio_change;
        vec4 previous = texelFetch(source, max(texel - i * axis, ivec2(0)), 0);
        sum += weight * (previous + texelFetch(source, min(texel + i * axis, last), 0));
        total_weight += 2.0 * weight;
    }
    blurred = sum / total_weight;
}
