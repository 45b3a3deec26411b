// Lighting of a vertex or a face, from the material's factors without textures. The diffuse part is for a white
// surface: fragments multiply it by their diffuse reflectance. Lights with shadows are kept separate, because fragments
// look up their visibility.
#include <pass_view.glsl>
#include <lights.glsl>
#include <math.glsl>
#include <environment_lighting.glsl>

struct VertexLight {
    ReflectedLight environment;
    ReflectedLight unshadowed;  // of all lights without shadows
#if SHADOW_LIGHT_COUNT > 0
    ReflectedLight shadowed[SHADOW_LIGHT_COUNT];
#endif
};

VertexLight vertex_light(int material, vec3 position, vec3 normal) {
    MaterialData m = materials[MATERIAL_INDEX(material)];
    Surface s;
    s.position = position;
    s.normal = normal;
    s.geometric_normal = normal;
    s.view_dir = view_dir(PASS_VIEW, position);
#ifdef DOUBLE_SIDED
    if (dot(s.normal, s.view_dir) < 0.0) s.normal = -s.normal;
#endif
    s.base_color = m.base_color.rgb;
    s.metallic = m.surface.x;
    s.roughness = m.surface.y;
    s.emissive = vec3(0.0);
    s.anisotropy = 0.0;
    s.tangent = any_tangent(s.normal);
    s.bitangent = cross(s.normal, s.tangent);
    derive_reflectance(s, m, m.specular);
    s.diffuse = vec3(1.0);

    VertexLight sum;
    sum.environment = environment_lighting(s);
    sum.unshadowed = ReflectedLight(vec3(0.0), vec3(0.0));
#if LIGHT_COUNT > 0
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) sum.shadowed[k] = sum.unshadowed;
#endif
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 light_dir;
        vec3 irradiance = irradiance_from(lights[i], position, light_dir);
        ReflectedLight light = shade(s, light_dir);
        light.diffuse *= irradiance;
        light.specular *= irradiance;
        bool has_shadow = false;
#if SHADOW_LIGHT_COUNT > 0
        for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
            if (shadow_lights[k] == i) {
                sum.shadowed[k] = light;
                has_shadow = true;
            }
        }
#endif
        if (!has_shadow) {
            sum.unshadowed.diffuse += light.diffuse;
            sum.unshadowed.specular += light.specular;
        }
    }
#endif
    return sum;
}
