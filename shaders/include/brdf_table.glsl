// The split-sum BRDF (Karis 2013): the fraction of uniform light from all around that GGX reflects to the viewer.
uniform sampler2D brdf_table;  // over (sqrt(NoV), roughness): the reflectance is f0 * x + f90 * y

// Fraction of uniform light from all around that the specular lobe reflects, at a perceptual roughness; linear RGB.
vec3 ggx_albedo(vec3 f0, float f90, float NoV, float roughness) {
    vec2 brdf = textureLod(brdf_table, vec2(sqrt(NoV), roughness), 0.0).xy;
    vec3 albedo = f0 * brdf.x + f90 * brdf.y;
#if MULTIPLE_SCATTERING
    albedo *= 1.0 + f0 * (1.0 / max(brdf.x + brdf.y, 1e-3) - 1.0);  // multiple scattering (Turquin 2019)
#endif
    return albedo;
}
