// The surface that a G-buffer holds at a texel, for the shading models: what `gbuffer.frag` wrote.
#include <depth_surface.glsl>
#include <math.glsl>
#include <surface.glsl>

#if DEPTH_SAMPLES > 1
#define SAMPLER_2D sampler2DMS
#else
#define SAMPLER_2D sampler2D
#endif
// Which sample of its texel a fragment lights; one that asks for its own number is run for each.
#if defined(PER_SAMPLE)
#define SAMPLE_INDEX gl_SampleID
#elif defined(ONE_SAMPLE)
uniform int sample_number;
#define SAMPLE_INDEX sample_number
#define position_at position_at_sample
#else
#define SAMPLE_INDEX TEXEL_CENTER
#endif

uniform SAMPLER_2D albedo;
#ifdef HAS_NORMAL
uniform SAMPLER_2D normal;
#endif
#ifdef HAS_MATERIAL
uniform SAMPLER_2D material;
#endif
#ifdef HAS_EMISSIVE
uniform SAMPLER_2D emissive;
#endif
#ifdef HAS_SPECULAR
uniform SAMPLER_2D specular;
#endif
#ifdef HAS_GRAIN
uniform SAMPLER_2D grain;
#endif
#ifdef HAS_PHONG_DIFFUSE
uniform SAMPLER_2D phong_diffuse;
#endif
#ifdef HAS_PHONG_SPECULAR
uniform SAMPLER_2D phong_specular;
#endif
#ifdef HAS_PHONG_AMBIENT
uniform SAMPLER_2D phong_ambient;
#endif

#ifdef HAS_NORMAL
// Of no unit length in the middle of all samples.
vec3 stored_normal(ivec2 texel, int number) {
    vec3 sum = texelFetch(normal, texel, max(number, 0)).xyz;
#if DEPTH_SAMPLES > 1 && !defined(ONE_SAMPLE)
    for (int i = 1; i < DEPTH_SAMPLES && number == TEXEL_CENTER; ++i) sum += texelFetch(normal, texel, i).xyz;
#endif
    return sum;
}
#endif

// What a sample of a texel holds, by its number, or TEXEL_CENTER: what a texel holds whose samples are alike. False
// where nothing is.
bool surface_at(ivec2 texel, int number, out Surface s) {
    float d;
    s.position = position_at(texel, number, d);
    if (is_nothing(d)) return false;
    s.view_dir = view_dir(depth_views[0], s.position);
#ifdef HAS_LOOKUP
    s.geometric_normal = geometric_normal_at(texel, number, s.position, d);
#else
    s.geometric_normal = vec3(0.0);  // shadows in screen space need none
#endif
#ifdef HAS_NORMAL
    s.normal = normalize(stored_normal(texel, number));
#endif
    number = max(number, 0);
    s.base_color = texelFetch(albedo, texel, number).rgb;
    s.base_color *= s.base_color;
    s.alpha = 1.0;
    s.lit = 1.0;
#ifdef HAS_MATERIAL
    vec4 stored = texelFetch(material, texel, number);
    s.metallic = stored.x;
    s.roughness = stored.y;
    s.occlusion = stored.z;
    s.lit = stored.w;
#endif
    s.emissive = vec3(0.0);
#ifdef HAS_EMISSIVE
    s.emissive = texelFetch(emissive, texel, number).rgb;
#endif
    s.dielectric = vec4(0.04, 0.04, 0.04, 1.0);
#ifdef HAS_SPECULAR
    s.dielectric = texelFetch(specular, texel, number);
    s.dielectric.rgb *= s.dielectric.rgb;
#endif
    physical_reflectance(s, s.dielectric);
#ifdef NEEDS_PHONG
    s.exponent = phong_exponent(s.roughness);
#ifdef HAS_PHONG_DIFFUSE
    s.diffuse = texelFetch(phong_diffuse, texel, number).rgb;
    s.diffuse *= s.diffuse;
#endif
#ifdef HAS_PHONG_SPECULAR
    s.f0 = texelFetch(phong_specular, texel, number).rgb;
    s.f0 *= s.f0;
#endif
#ifdef HAS_PHONG_AMBIENT
    s.ambient = texelFetch(phong_ambient, texel, number).rgb;
    s.ambient *= s.ambient;
#endif
#endif
#ifdef NEEDS_GRAIN
    s.anisotropy = 0.0;
    s.tangent = any_tangent(s.normal);
#ifdef HAS_GRAIN
    vec4 direction = texelFetch(grain, texel, number);
    s.anisotropy = direction.w;
    s.tangent = normalize(direction.xyz);
#endif
    s.bitangent = cross(s.normal, s.tangent);
#endif
    return true;
}
