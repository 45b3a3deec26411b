// Writes the surface of a fragment to the G-buffer; `gbuffer_surface.glsl` reads it back.
#include <pass_view.glsl>
#include <fragment_surface.glsl>

#ifdef WRITES_ALBEDO
out vec4 albedo;  // square root of the base colour; 1
#endif
#ifdef WRITES_NORMAL
out vec4 normal;  // shading normal in world space; 0
#endif
#ifdef WRITES_MATERIAL
out vec4 material;  // metallic, roughness, occlusion; 0 if unlit, else 1
#endif
#ifdef WRITES_EMISSIVE
out vec4 emissive;
#endif
#ifdef WRITES_SPECULAR
out vec4 specular;  // of the dielectric part: square root of f0 (0.04 then quantizes to 8 bits exactly); f90
#endif
#ifdef WRITES_GRAIN
out vec4 grain;  // tangent in world space; anisotropy strength
#endif
#ifdef WRITES_PHONG_DIFFUSE
out vec4 phong_diffuse;  // square roots, here and below: dark reflectances need finer steps under bright lights
#endif
#ifdef WRITES_PHONG_SPECULAR
out vec4 phong_specular;
#endif
#ifdef WRITES_PHONG_AMBIENT
out vec4 phong_ambient;
#endif
#ifdef WRITES_VELOCITY
#include <fragment_velocity.glsl>
out vec2 velocity;
#endif

void main() {
    Surface s = fragment_surface(PASS_VIEW);
#ifdef WRITES_ALBEDO
    albedo = vec4(sqrt(s.base_color), 1.0);
#endif
#ifdef WRITES_NORMAL
    normal = vec4(s.normal, 0.0);
#endif
#ifdef WRITES_MATERIAL
    material = vec4(s.metallic, s.roughness, s.occlusion, s.lit);
#endif
#ifdef WRITES_EMISSIVE
    emissive = vec4(s.emissive, 1.0);
#endif
#ifdef WRITES_SPECULAR
    specular = vec4(sqrt(s.dielectric.rgb), s.dielectric.a);
#endif
#ifdef WRITES_GRAIN
    grain = vec4(s.tangent, s.anisotropy);
#endif
#ifdef WRITES_VELOCITY
    velocity = fragment_velocity();
#endif
    empirical_reflectance(s, materials[MATERIAL_INDEX(v_material)]);
#ifdef WRITES_PHONG_DIFFUSE
    phong_diffuse = vec4(sqrt(s.diffuse), 1.0);
#endif
#ifdef WRITES_PHONG_SPECULAR
    phong_specular = vec4(sqrt(s.f0), 1.0);
#endif
#ifdef WRITES_PHONG_AMBIENT
    phong_ambient = vec4(sqrt(s.ambient), 1.0);
#endif
}
