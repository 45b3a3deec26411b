// Reads the surface at a texel of the G-buffer that `gbuffer.frag` wrote.
#include <depth_surface.glsl>
#include <math.glsl>
#include <surface.glsl>

#if DEPTH_SAMPLES > 1
#define SAMPLER_2D sampler2DMS
#else
#define SAMPLER_2D sampler2D
#endif
// The sample of its texel that a fragment shades. Reading gl_SampleID runs the shader per sample.
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
// Normal of a sample, or the sum of the normals of all samples at TEXEL_CENTER, which is not normalized.
vec3 gbuffer_normal(ivec2 texel, int sample_index) {
    vec3 sum = texelFetch(normal, texel, max(sample_index, 0)).xyz;
#if DEPTH_SAMPLES > 1 && !defined(ONE_SAMPLE)
    for (int i = 1; i < DEPTH_SAMPLES && sample_index == TEXEL_CENTER; ++i) sum += texelFetch(normal, texel, i).xyz;
#endif
    return sum;
}
#endif

// Reads the surface of a sample, or with TEXEL_CENTER the surface of a texel whose samples all see the same one.
// Returns false on the background.
bool surface_at(ivec2 texel, int sample_index, out Surface s) {
    float window_depth;
    s.position = position_at(texel, sample_index, window_depth);
    if (is_nothing(window_depth)) return false;
    s.view_dir = view_dir(depth_views[0], s.position);
#ifdef HAS_LOOKUP
    s.geometric_normal = geometric_normal_at(texel, sample_index, s.position, window_depth);
#else
    s.geometric_normal = vec3(0.0);  // screen-space visibility needs none
#endif
#ifdef HAS_NORMAL
    s.normal = normalize(gbuffer_normal(texel, sample_index));
#endif
    sample_index = max(sample_index, 0);
    s.base_color = texelFetch(albedo, texel, sample_index).rgb;
    s.base_color *= s.base_color;
    s.alpha = 1.0;
    s.lit = 1.0;
#ifdef HAS_MATERIAL
    vec4 parameters = texelFetch(material, texel, sample_index);
    s.metallic = parameters.x;
    s.roughness = parameters.y;
    s.occlusion = parameters.z;
    s.lit = parameters.w;
#endif
    s.emissive = vec3(0.0);
#ifdef HAS_EMISSIVE
    s.emissive = texelFetch(emissive, texel, sample_index).rgb;
#endif
    s.dielectric = vec4(0.04, 0.04, 0.04, 1.0);
#ifdef HAS_SPECULAR
    s.dielectric = texelFetch(specular, texel, sample_index);
    s.dielectric.rgb *= s.dielectric.rgb;
#endif
    physical_reflectance(s, s.dielectric);
    share_energy(s);
#ifdef NEEDS_PHONG
    s.exponent = phong_exponent(s.roughness);
#ifdef HAS_PHONG_DIFFUSE
    s.diffuse = texelFetch(phong_diffuse, texel, sample_index).rgb;
    s.diffuse *= s.diffuse;
#endif
#ifdef HAS_PHONG_SPECULAR
    s.f0 = texelFetch(phong_specular, texel, sample_index).rgb;
    s.f0 *= s.f0;
#endif
#ifdef HAS_PHONG_AMBIENT
    s.ambient = texelFetch(phong_ambient, texel, sample_index).rgb;
    s.ambient *= s.ambient;
#endif
#endif
#ifdef NEEDS_GRAIN
    s.anisotropy = 0.0;
    s.tangent = any_tangent(s.normal);
#ifdef HAS_GRAIN
    vec4 tangent = texelFetch(grain, texel, sample_index);
    s.anisotropy = tangent.w;
    s.tangent = normalize(tangent.xyz);
#endif
    s.bitangent = cross(s.normal, s.tangent);
#endif
    return true;
}
