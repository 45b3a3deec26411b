// Sheen of cloth: the Charlie distribution and its masking (Estevez and Kulla, "Production Friendly Microfacet Sheen
// BRDF", 2017), as in KHR_materials_sheen.
#include <math.glsl>

const float LEAST_SHEEN_ROUGHNESS = 0.07;  // below, the distribution is a spike beyond float32

// Distribution of fibre normals, in 1/sr, from the cosine NoH of the half vector's angle. `roughness` is perceptual.
float distribution_charlie(float NoH, float roughness) {
    float exponent = 1.0 / (roughness * roughness);
    return (2.0 + exponent) * pow(max(1.0 - NoH * NoH, 1e-7), 0.5 * exponent) / (2.0 * PI);
}

// The fit of the paper to the masking of a direction with this `cosine` to the normal, 0 to 0.5.
float charlie_fit(float cosine, float alpha) {
    float t = (1.0 - alpha) * (1.0 - alpha);
    float a = mix(21.5473, 25.3245, t), b = mix(3.82987, 3.32435, t), c = mix(0.19823, 0.16801, t);
    float d = mix(-1.97760, -1.27393, t), e = mix(-4.32054, -4.85967, t);
    return a / (1.0 + b * pow(cosine, c)) + d * cosine + e;
}

// Masking Λ of a direction with this cosine to the normal.
float charlie_masking(float cosine, float alpha) {
    return exp(cosine < 0.5 ? charlie_fit(max(cosine, 1e-5), alpha)
                            : 2.0 * charlie_fit(0.5, alpha) - charlie_fit(max(1.0 - cosine, 1e-5), alpha));
}

// Distribution times masking, in 1/sr: the BRDF of white sheen, before it is limited to the arriving light.
float charlie_brdf(float NoL, float NoV, float NoH, float roughness) {
    float alpha = roughness * roughness;
    float masking = 1.0 + charlie_masking(NoV, alpha) + charlie_masking(NoL, alpha);
    return distribution_charlie(NoH, roughness) / (masking * 4.0 * max(NoL * NoV, 1e-7));
}
