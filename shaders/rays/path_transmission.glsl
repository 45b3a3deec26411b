// Light that passes through a surface on paths: thin walls, and volumes that refract, disperse and absorb. For scenes
// with materials that transmit.
#include <layered_light.glsl>
#include <sampled_directions.glsl>
#include "path_light.glsl"

// The state of a path in volumes.
struct Medium {
    vec3 absorption;  // per metre, where the path is
    int channel;      // the colour channel that dispersion has left of the path; -1 for all
    bool has_entered; // whether the path has passed through a transmissive surface
};

// Whether a surface bounds a volume and not only a thin wall.
bool is_volume(Surface s) {
    return s.transmission > 0.0 && s.thickness > 0.0;
}

// Roughness² of a lobe that passes through a thin wall: an index of refraction of 1 blurs nothing.
float thin_alpha(Surface s) {
    float roughness = s.roughness * clamp(2.0 * s.ior - 2.0, 0.0, 1.0);
    return max(roughness * roughness, 0.001);
}

// Reflectance of the boundary of a transmissive surface.
vec3 boundary_reflectance(Surface s, float VoH) {
    vec3 fresnel = fresnel_schlick(s.dielectric.rgb, s.dielectric.a, VoH);
#ifdef IRIDESCENCE_LAYER
    fresnel = mix(fresnel, film_reflectance(s.film_ior, s.film_thickness, s.dielectric.rgb, VoH), s.iridescence);
#endif
    return min(fresnel, 1.0);
}

// Fraction of light to the viewer that passes through coat and sheen.
float below_layers(Surface s) {
    float left = 1.0;
#ifdef SHEEN_LAYER
    left *= below_sheen(s, sheen_albedo(s, max(dot(s.normal, s.view_dir), 0.0)));
#endif
#ifdef CLEARCOAT_LAYER
    left *= 1.0 - clearcoat_reflectance(s, dot(s.clearcoat_normal, s.view_dir));
#endif
    return left;
}

// Radiance to the viewer through a thin wall for an irradiance of 1 on its other side that faces the light: the
// microfacet lobe of reflection, mirrored.
vec3 thin_transmission(Surface s, vec3 light_dir) {
    vec3 mirrored = light_dir - 2.0 * dot(light_dir, s.normal) * s.normal;
    float NoL = dot(s.normal, mirrored), NoV = max(dot(s.normal, s.view_dir), 1e-4);
    if (NoL <= 0.0 || s.transmission <= 0.0 || s.thickness > 0.0) return vec3(0.0);
    vec3 h = normalize(mirrored + s.view_dir);
    float alpha = thin_alpha(s);
    float lobe = distribution_ggx(s.normal, h, alpha) * visibility_smith(NoL, NoV, alpha) * NoL;
    return s.base_color * (1.0 - boundary_reflectance(s, max(dot(s.view_dir, h), 0.0)))
        * (s.transmission * lobe * below_layers(s));
}

// Probability that a path goes through the surface.
float transmission_chance(Surface s) {
    if (s.transmission <= 0.0) return 0.0;
    float NoV = clamp(dot(s.normal, s.view_dir), 1e-4, 1.0);
    float reflected = luminance_of(boundary_reflectance(s, NoV));
    float through = s.transmission * luminance_of(s.base_color) * (1.0 - reflected) * below_layers(s);
    float other = reflected + luminance_of(s.diffuse) + 1.0 - below_layers(s);
    return through > 0.0 ? clamp(through / (through + other), 0.05, 0.95) : 0.0;
}

// The direction of a path through the boundary; returns its throughput over the probability of the direction, 0 if
// there is none. `is_back`: the path comes from inside the volume. The boundary may then also reflect it, which sets
// `is_inside`.
vec3 pass_through(
    Surface s, bool is_back, vec3 xi, inout Medium medium, out vec3 direction, out bool is_inside) {
    mat3 frame = tangent_frame_of(s.normal);
    vec3 v = viewer_above(s.view_dir * frame);
    float ior = s.ior;
    vec3 kept = vec3(1.0);
    is_inside = false;
    if (!is_volume(s)) {
        float alpha = thin_alpha(s);
        vec3 h = sample_visible_normal(v, vec2(alpha), xi.xy), l = reflect(-v, h);
        direction = frame * vec3(l.xy, -l.z);
        if (l.z <= 0.0) return vec3(0.0);
        float shape = visibility_smith(l.z, v.z, alpha) * l.z / visible_normal_density(v, vec2(alpha));
        return s.base_color * (1.0 - boundary_reflectance(s, dot(v, h))) * (s.transmission * shape * below_layers(s));
    }
    if (s.dispersion > 0.0) {  // one of the colours: red is refracted least, and blue most
        if (medium.channel < 0) {
            medium.channel = min(int(3.0 * xi.z), 2);
            xi.z = fract(3.0 * xi.z);
            kept = vec3(0.0);
            kept[medium.channel] = 3.0;
        }
        ior += (s.ior - 1.0) * 0.025 * s.dispersion * float(medium.channel - 1);
    }
    float alpha = max(s.roughness * s.roughness, 0.001), eta = is_back ? ior : 1.0 / ior;
    vec3 h = sample_visible_normal(v, vec2(alpha), xi.xy);
    float VoH = dot(v, h), sine2 = eta * eta * (1.0 - VoH * VoH);
    vec3 reflected = sine2 >= 1.0 ? vec3(1.0) : boundary_reflectance(s, is_back ? sqrt(1.0 - sine2) : VoH);
    float reflects = is_back ? luminance_of(reflected) : 0.0;
    is_inside = xi.z < reflects;
    vec3 l = is_inside ? reflect(-v, h) : refract(-v, h, eta);
    direction = frame * l;
    if (is_inside ? l.z <= 0.0 : l.z >= 0.0) return vec3(0.0);
    float NoL = abs(l.z), a2 = alpha * alpha;
    float shadowing = 2.0 * NoL / (NoL + sqrt(a2 + (1.0 - a2) * NoL * NoL));
    if (is_inside) return kept * reflected * (shadowing / reflects);
    medium.absorption = is_back ? vec3(0.0) : s.absorption;
    // Light passes two boundaries of a volume, and is tinted by the base colour once.
    return kept * sqrt(s.base_color) * (1.0 - reflected)
        * (shadowing * (is_back ? 1.0 : s.transmission * below_layers(s)) / (1.0 - reflects));
}
