// The surface that a G-buffer holds at a texel, for the shading models: what `gbuffer.frag` wrote.
#include <depth_surface.glsl>
#include <math.glsl>
#include <surface.glsl>

uniform sampler2D albedo;
#ifdef HAS_NORMAL
uniform sampler2D normal;
#endif
#ifdef HAS_MATERIAL
uniform sampler2D material;
#endif
#ifdef HAS_EMISSIVE
uniform sampler2D emissive;
#endif
#ifdef HAS_SPECULAR
uniform sampler2D specular;
#endif
#ifdef HAS_GRAIN
uniform sampler2D grain;
#endif
#ifdef HAS_PHONG_DIFFUSE
uniform sampler2D phong_diffuse;
#endif
#ifdef HAS_PHONG_SPECULAR
uniform sampler2D phong_specular;
#endif
#ifdef HAS_PHONG_AMBIENT
uniform sampler2D phong_ambient;
#endif

// False where nothing is.
bool surface_at(ivec2 texel, out Surface s) {
    float d;
    s.position = position_at(texel, d);
    if (d == 1.0) return false;
    s.to_viewer = to_viewer(depth_views[0], s.position);
#ifdef HAS_LOOKUP
    s.geometric_normal = geometric_normal_at(texel, s.position, d);
#else
    s.geometric_normal = vec3(0.0);  // shadows in screen space need none
#endif
    s.base_color = texelFetch(albedo, texel, 0).rgb;
    s.alpha = 1.0;
    s.lit = 1.0;
#ifdef HAS_NORMAL
    s.normal = normalize(texelFetch(normal, texel, 0).xyz);
#endif
#ifdef HAS_MATERIAL
    vec4 stored = texelFetch(material, texel, 0);
    s.metallic = stored.x;
    s.roughness = stored.y;
    s.occlusion = stored.z;
    s.lit = stored.w;
#endif
#ifdef HAS_EMISSIVE
    s.emissive = texelFetch(emissive, texel, 0).rgb;
#endif
    s.dielectric = vec4(0.04, 0.04, 0.04, 1.0);
#ifdef HAS_SPECULAR
    s.dielectric = texelFetch(specular, texel, 0);
    s.dielectric.rgb *= s.dielectric.rgb;
#endif
    physical_reflectance(s, s.dielectric);
#ifdef NEEDS_PHONG
    s.exponent = phong_exponent(s.roughness);
#ifdef HAS_PHONG_DIFFUSE
    s.diffuse = texelFetch(phong_diffuse, texel, 0).rgb;
    s.diffuse *= s.diffuse;
#endif
#ifdef HAS_PHONG_SPECULAR
    s.f0 = texelFetch(phong_specular, texel, 0).rgb;
    s.f0 *= s.f0;
#endif
#ifdef HAS_PHONG_AMBIENT
    s.ambient = texelFetch(phong_ambient, texel, 0).rgb;
    s.ambient *= s.ambient;
#endif
#endif
#ifdef NEEDS_GRAIN
    s.anisotropy = 0.0;
    s.tangent = any_tangent(s.normal);
#ifdef HAS_GRAIN
    vec4 direction = texelFetch(grain, texel, 0);
    s.anisotropy = direction.w;
    s.tangent = normalize(direction.xyz);
#endif
    s.bitangent = cross(s.normal, s.tangent);
#endif
    return true;
}
