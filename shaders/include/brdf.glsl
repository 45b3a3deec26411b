// Microfacet terms. GGX: Walter et al. 2007; height-correlated Smith visibility: Heitz 2014; Fresnel: Schlick 1994.
#include <math.glsl>

float distribution_ggx(float NoH, float alpha) {
    float a2 = alpha * alpha;
    float d = (NoH * a2 - NoH) * NoH + 1.0;
    return a2 / (PI * d * d);
}

// The same for unit vectors: their cross product keeps the digits that 1 - (N.H)^2 loses near a smooth surface's peak.
float distribution_ggx(vec3 n, vec3 h, float alpha) {
    vec3 sine = cross(n, h);
    float NoH = max(dot(n, h), 0.0), a = NoH * alpha, d = dot(sine, sine) + a * a;
    return alpha * alpha / (PI * d * d);
}

// Masking and shadowing over 4 N.L N.V.
float visibility_smith(float NoL, float NoV, float alpha) {
    float a2 = alpha * alpha;
    float from_viewer = NoL * sqrt(NoV * NoV * (1.0 - a2) + a2);
    float from_light = NoV * sqrt(NoL * NoL * (1.0 - a2) + a2);
    return 0.5 / (from_viewer + from_light);
}

// The same with the roots replaced by a straight line (Hammon 2017): up to 15 % off at grazing angles.
float visibility_smith_fast(float NoL, float NoV, float alpha) {
    return 0.5 / mix(2.0 * NoL * NoV, NoL + NoV, alpha);
}

vec3 fresnel_schlick(vec3 f0, float f90, float VoH) {
    float x = 1.0 - VoH;
    float x2 = x * x;
    return f0 + (f90 - f0) * (x2 * x2 * x);
}

// Anisotropic GGX as KHR_materials_anisotropy has it (Burley 2012, Heitz 2014).
float distribution_ggx_anisotropic(float NoH, float ToH, float BoH, float alpha_t, float alpha_b) {
    float a2 = alpha_t * alpha_b;
    vec3 f = vec3(alpha_b * ToH, alpha_t * BoH, a2 * NoH);
    float w2 = a2 / dot(f, f);
    return a2 * w2 * w2 / PI;
}

// Directions as (along the tangent, along the bitangent, along the normal).
float visibility_smith_anisotropic(vec3 light, vec3 viewer, float alpha_t, float alpha_b) {
    vec3 alpha = vec3(alpha_t, alpha_b, 1.0);
    return 0.5 / (light.z * length(alpha * viewer) + viewer.z * length(alpha * light));
}
