// Reflectance of a thin film on a base (L. Belcour and P. Barla, "A Practical Extension to Microfacet Theory for the
// Modeling of Varying Iridescence", 2017), simplified as in KHR_materials_iridescence: light is not polarized, and
// Fresnel factors follow Schlick. The sum over the orders of interference is integrated against the eye's sensitivity
// in closed form, so that three channels do not alias as three wavelengths would.
#include <brdf.glsl>

// The three sensitivity curves as Gaussians in Fourier space, at an optical path difference (nm) and a phase `shift`;
// in linear sRGB.
vec3 film_sensitivity(float path, vec3 shift) {
    float phase = 2.0 * PI * path * 1e-9;
    const vec3 value = vec3(5.4856e-13, 4.4201e-13, 5.2481e-13);
    const vec3 position = vec3(1.6810e+06, 1.7953e+06, 2.2084e+06);
    const vec3 variance = vec3(4.3278e+09, 9.3046e+09, 6.6121e+09);
    vec3 xyz = value * sqrt(2.0 * PI * variance) * cos(position * phase + shift) * exp(-phase * phase * variance);
    xyz.x += 9.7470e-14 * sqrt(2.0 * PI * 4.5282e+09) * cos(2.2399e+06 * phase + shift.x)
        * exp(-4.5282e+09 * phase * phase);
    xyz /= 1.0685e-7;
    const mat3 xyz_to_srgb =
        mat3(3.2404542, -0.9692660, 0.0556434, -1.5371385, 1.8760108, -0.2040259, -0.4985314, 0.0415560, 1.0572252);
    return xyz_to_srgb * xyz;
}

// Reflectance at normal incidence between two indices of refraction, `inside` and `outside`.
vec3 interface_f0(vec3 inside, float outside) {
    vec3 ratio = (inside - outside) / (inside + outside);
    return ratio * ratio;
}

// Reflectance, linear RGB 0 to 1, of a film of this `ior` and `thickness` (nm) in air on a base of reflectance `f0`, at
// the cosine VoH of the angle to the (micro-)normal.
vec3 film_reflectance(float ior, float thickness, vec3 f0, float VoH) {
    ior = mix(1.0, ior, smoothstep(0.0, 30.0, thickness));  // a vanishing film leaves the base unchanged
    float sine2 = (1.0 - VoH * VoH) / (ior * ior);
    if (sine2 >= 1.0) return vec3(1.0);
    float cosine = sqrt(1.0 - sine2);  // within the film

    float r0 = interface_f0(vec3(ior), 1.0).r;
    float outer = fresnel_schlick(vec3(r0), 1.0, VoH).r, through = 1.0 - outer;
    vec3 root = sqrt(clamp(f0, 0.0, 0.9999));
    vec3 base_ior = (1.0 + root) / (1.0 - root);
    vec3 inner = fresnel_schlick(interface_f0(base_ior, ior), 1.0, cosine);
    vec3 shift = vec3(ior < 1.0 ? 0.0 : PI) + mix(vec3(0.0), vec3(PI), lessThan(base_ior, vec3(ior)));

    float path = 2.0 * ior * thickness * cosine;
    vec3 both = clamp(outer * inner, 1e-5, 0.9999), amplitude = sqrt(both);
    vec3 transmitted = through * through * inner / (1.0 - both);
    vec3 sum = outer + transmitted, order = transmitted - through;
    for (int m = 1; m <= 2; ++m) {
        order *= amplitude;
        sum += order * 2.0 * film_sensitivity(float(m) * path, float(m) * shift);
    }
    return clamp(sum, 0.0, 1.0);
}

// The f0 with which Schlick's formula (f90 of 1) gives `reflectance` at the cosine NoV, for the split sum.
vec3 schlick_f0(vec3 reflectance, float NoV) {
    float x = clamp(1.0 - NoV, 0.0, 1.0), x5 = min(x * x * x * x * x, 0.9999);
    return clamp((reflectance - x5) / (1.0 - x5), 0.0, 1.0);
}
