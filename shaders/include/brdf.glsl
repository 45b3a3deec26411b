// Microfacet terms. GGX: Walter et al. 2007; height-correlated Smith visibility: Heitz 2014; Fresnel: Schlick 1994.
#include <math.glsl>

// GGX distribution D of normals, in 1/sr, from the cosine NoH of the half vector's angle.
float distribution_ggx(float NoH, float alpha) {
    float a2 = alpha * alpha;
    float d = (NoH * a2 - NoH) * NoH + 1.0;
    return a2 / (PI * d * d);
}

// The same from unit vectors, whose cross product keeps the digits that 1 - NoH² loses to cancellation near the peak of
// a smooth surface.
float distribution_ggx(vec3 normal, vec3 half_vector, float alpha) {
    vec3 NxH = cross(normal, half_vector);
    float NoH = max(dot(normal, half_vector), 0.0), a = NoH * alpha, d = dot(NxH, NxH) + a * a;
    return alpha * alpha / (PI * d * d);
}

// Smith masking-shadowing divided by 4 NoL NoV, with the height correlation of Heitz 2014.
float visibility_smith(float NoL, float NoV, float alpha) {
    float a2 = alpha * alpha;
    float masking = NoL * sqrt(NoV * NoV * (1.0 - a2) + a2);
    float shadowing = NoV * sqrt(NoL * NoL * (1.0 - a2) + a2);
    return 0.5 / (masking + shadowing);
}

// The same, approximated without square roots (Hammon 2017); up to 15 % off at grazing angles.
float visibility_smith_fast(float NoL, float NoV, float alpha) {
    return 0.5 / mix(2.0 * NoL * NoV, NoL + NoV, alpha);
}

// Fresnel reflectance, 0 to 1, at the cosine VoH of the angle between a direction and the half vector: from f0 at
// normal to f90 at grazing incidence.
vec3 fresnel_schlick(vec3 f0, float f90, float VoH) {
    float x = 1.0 - VoH;
    float x2 = x * x;
    return f0 + (f90 - f0) * (x2 * x2 * x);
}

// Anisotropic GGX distribution as in KHR_materials_anisotropy (Burley 2012, Heitz 2014), in 1/sr. NoH, ToH and BoH are
// the half vector along normal, tangent and bitangent; alpha_t and alpha_b are the squared roughness along the latter
// two.
float distribution_ggx_anisotropic(float NoH, float ToH, float BoH, float alpha_t, float alpha_b) {
    float a2 = alpha_t * alpha_b;
    vec3 f = vec3(alpha_b * ToH, alpha_t * BoH, a2 * NoH);
    float w2 = a2 / dot(f, f);
    return a2 * w2 * w2 / PI;
}

// Anisotropic masking-shadowing, divided by 4 NoL NoV, with the same alpha_t and alpha_b. light_dir and view_dir are in
// tangent space: x along the tangent, y along the bitangent, z along the normal.
float visibility_smith_anisotropic(vec3 light_dir, vec3 view_dir, float alpha_t, float alpha_b) {
    vec3 alpha = vec3(alpha_t, alpha_b, 1.0);
    return 0.5 / (light_dir.z * length(alpha * view_dir) + view_dir.z * length(alpha * light_dir));
}
