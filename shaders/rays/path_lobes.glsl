// Light that a surface with layers reflects and transmits on paths: which lobe a path follows, in which direction, and
// with which density. Without layers these are the functions of the shading model alone.
#include <layered_light.glsl>
#include <sampled_directions.glsl>
#include "path_light.glsl"
#ifdef TRANSMISSION_LAYER
#include "path_transmission.glsl"
#endif

// Chances of coat, sheen and base, among directions that are reflected.
vec3 layer_chances(Surface s) {
    vec3 chances = vec3(0.0, 0.0, 1.0);
#ifdef HAS_LAYERS
    float NoV = clamp(dot(s.normal, s.view_dir), 1e-4, 1.0);
#ifdef SHEEN_LAYER
    float fibres = max(max(s.sheen_color.r, s.sheen_color.g), s.sheen_color.b);
    chances.y = fibres * min(sheen_albedo(s, NoV), 1.0);
    chances.z *= 1.0 - chances.y;
    if (fibres > 0.0) chances.y = max(chances.y, 0.05);
#endif
#ifdef CLEARCOAT_LAYER
    if (s.clearcoat > 0.0) {
        float coat = clearcoat_reflectance(s, dot(s.clearcoat_normal, s.view_dir));
        chances.yz *= 1.0 - coat;
        chances.x = max(coat, 0.1);
    }
#endif
    vec3 base = s.diffuse + fresnel_schlick(s.f0, s.f90, NoV);
    chances.z *= clamp(luminance_of(base), 0.05, 1.0);
    chances /= chances.x + chances.y + chances.z;
#endif
    return chances;
}

// A direction that the surface reflects, from numbers from 0 to 1.
vec3 reflected_direction(Surface s, vec3 xi) {
#if defined(CLEARCOAT_LAYER) || defined(SHEEN_LAYER)
    vec3 chances = layer_chances(s);
#ifdef CLEARCOAT_LAYER
    if (xi.z < chances.x) {
        mat3 frame = tangent_frame_of(s.clearcoat_normal);
        vec3 v = viewer_above(s.view_dir * frame);
        float alpha = max(s.clearcoat_roughness * s.clearcoat_roughness, 0.001);
        return frame * reflect(-v, sample_visible_normal(v, vec2(alpha), xi.xy));
    }
#endif
    if (xi.z < chances.x + chances.y) return tangent_frame_of(s.normal) * sample_cosine(xi.xy);
    xi.z = (xi.z - chances.x - chances.y) / chances.z;
#endif
    return sample_direction(s, xi);
}

// Density of this choice, in 1/sr.
float reflected_density(Surface s, vec3 light_dir) {
    float density = direction_density(s, light_dir);
#if defined(CLEARCOAT_LAYER) || defined(SHEEN_LAYER)
    vec3 chances = layer_chances(s);
    density = chances.z * density + chances.y * max(dot(s.normal, light_dir), 0.0) / PI;
#ifdef CLEARCOAT_LAYER
    mat3 frame = tangent_frame_of(s.clearcoat_normal);
    vec3 v = viewer_above(s.view_dir * frame), h = normalize(light_dir * frame + v);
    float alpha = max(s.clearcoat_roughness * s.clearcoat_roughness, 0.001);
    if (h.z > 0.0) {
        density += chances.x * distribution_ggx(vec3(0.0, 0.0, 1.0), h, alpha) * visible_normal_density(v, vec2(alpha));
    }
#endif
#endif
#ifdef TRANSMISSION_LAYER
    density *= 1.0 - transmission_chance(s);
#endif
    return density;
}
