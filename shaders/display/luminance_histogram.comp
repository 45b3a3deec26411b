// Builds a histogram of the picture's luminance, in bins of an eighth of a stop. Each work group counts in shared
// memory first, because atomics there do not wait for other groups.
#include <luminance.glsl>
layout(local_size_x = 16, local_size_y = 16) in;

uniform sampler2D radiance;  // scene-linear, alpha is coverage
uniform float center_weight;
layout(std430) buffer histogram { uint bins[BINS]; };

shared uint counts[BINS];

// 15 for a pixel that counts in full: the sum of 16384 × 16384 of them still fits 32 bits.
uint weight_of(ivec2 texel, ivec2 size, float alpha) {
    vec2 place = (vec2(texel) + 0.5) / vec2(size) * 2.0 - 1.0;  // -1 to 1
    float weight = mix(1.0, exp(-2.0 * dot(place, place)), center_weight);
#if METER == METER_COVERED || TRANSPARENT
    weight *= clamp(alpha, 0.0, 1.0);
#endif
    return uint(15.0 * weight + 0.5);
}

void main() {
    for (uint i = gl_LocalInvocationIndex; i < BINS; i += 256u) counts[i] = 0u;
    barrier();
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = textureSize(radiance, 0);
    if (all(lessThan(texel, size))) {
        vec4 source = texelFetch(radiance, texel, 0);
        float luminance = luminance_of(source.rgb);
        float stops = luminance > 0.0 ? log2(luminance) : -1e9;  // NaN becomes black
        int bin = int(clamp((stops - FIRST_STOP) * BINS_PER_STOP, 0.0, float(BINS - 1)));
        atomicAdd(counts[bin], weight_of(texel, size, source.a));
    }
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < BINS; i += 256u) {
        if (counts[i] > 0u) atomicAdd(bins[i], counts[i]);
    }
}
