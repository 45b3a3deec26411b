// Direct light on a surface with layers; unchanged without layers.
#include <layers.glsl>
#include <shading.glsl>

#ifdef HAS_LAYERS
// The light of one source that the layered surface reflects, given the light `base` that its base reflects, from
// `shade`. As for `shade`, exchanging viewer and light only changes the cosine.
ReflectedLight layered_light(Surface s, vec3 light_dir, ReflectedLight base) {
    vec3 half_vector = normalize(light_dir + s.view_dir);
#ifdef SHEEN_LAYER
    float NoL = max(dot(s.normal, light_dir), 0.0), NoV = max(dot(s.normal, s.view_dir), 1e-4);
    if (NoL > 0.0) {
        float to_light = sheen_albedo(s, NoL), to_viewer = sheen_albedo(s, NoV);
        float brdf = charlie_brdf(NoL, NoV, max(dot(s.normal, half_vector), 0.0), s.sheen_roughness);
        float left = min(below_sheen(s, to_light), below_sheen(s, to_viewer));
        base.diffuse *= left;
        base.specular = base.specular * left
            + s.sheen_color * (brdf * NoL / max(max(to_light, to_viewer), 1.0));  // narrow lobes reflect too much
    }
#endif
#ifdef CLEARCOAT_LAYER
    float coat_NoL = max(dot(s.clearcoat_normal, light_dir), 0.0);
    float coat_NoV = max(dot(s.clearcoat_normal, s.view_dir), 1e-4);
    float below = below_clearcoat(s, light_dir);
    float alpha = max(s.clearcoat_roughness * s.clearcoat_roughness, 0.001);
    float lobe = distribution_ggx(s.clearcoat_normal, half_vector, alpha) * visibility_smith(coat_NoL, coat_NoV, alpha);
    base.diffuse *= below;
    base.specular = base.specular * below
        + clearcoat_reflectance(s, max(dot(s.view_dir, half_vector), 0.0)) * lobe * coat_NoL;
#endif
    return base;
}
#endif
