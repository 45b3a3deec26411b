// One axis of a Gaussian: 2 radius + 1 taps at texel centres, normalised. The weights go from tap to tap by two
// multiplications (K. Turkowski, "Incremental Computation of the Gaussian", GPU Gems 3, 2007).
uniform sampler2D source;
uniform ivec2 axis;    // (1, 0) or (0, 1)
uniform int radius;    // texels, three standard deviations
out vec4 blurred;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(source, 0) - 1;
    float sigma = max(float(radius), 1.0) / 3.0;
    float ratio = exp(-0.5 / (sigma * sigma));
    float square = ratio * ratio;
    float weight = 1.0;
    float total = 1.0;
    vec4 sum = texelFetch(source, texel, 0);
    for (int i = 1; i <= radius; ++i) {
        weight *= ratio;
        ratio *= square;
        vec4 left = texelFetch(source, max(texel - i * axis, ivec2(0)), 0);
        sum += weight * (left + texelFetch(source, min(texel + i * axis, last), 0));
        total += 2.0 * weight;
    }
    blurred = sum / total;
}
