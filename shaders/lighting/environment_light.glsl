// Image-based lighting: nine spherical harmonics for diffuse surfaces, levels of a prefiltered cube map for specular
// lobes, and the environment map itself for the backdrop.
#include <environment.glsl>
#include <equirectangular.glsl>

uniform sampler2D map;
uniform samplerCube specular;       // levels of evenly increasing roughness, from 0
uniform samplerCube rough;          // the following levels, up to 1
uniform samplerCube between;        // levels halfway between those of `specular`
uniform samplerCube rough_between;  // levels halfway between those of `rough`
uniform sampler2D harmonics;

vec4 coefficient(int index) {
    return texelFetch(harmonics, ivec2(index, 0), 0);
}

// Irradiance / π.
vec3 diffuse_light(vec3 d) {
    vec4 linear = vec4(d, 1.0), quadratic = vec4(d.x * d.y, d.y * d.z, d.z * d.z, d.x * d.z);
    vec3 sum = coefficient(15).rgb * (d.x * d.x - d.y * d.y);
    for (int c = 0; c < 3; ++c) sum[c] += dot(coefficient(9 + c), linear) + dot(coefficient(12 + c), quadratic);
    return max(sum, 0.0);
}

// A measure of how narrow a lobe is. Its peak grows with the fourth power of 1 / roughness; the third power has the
// least error over peak and slopes together. The constant keeps it finite for mirrors.
float lobe_narrowness(float roughness) {
    return 1.0 / (roughness * roughness * roughness + 1.25e-4);
}

// Radiance of a specular lobe, interpolated between the two nearest levels. The weights are linear in the lobe's
// narrowness and not in roughness: otherwise highlights of small lights would be far too bright between two levels.
vec3 specular_light(vec3 d, float roughness) {
    int sharp_levels = textureQueryLevels(specular), last = sharp_levels + textureQueryLevels(rough) - 1;
    float step = 0.5 / float(last);  // difference of roughness to the level halfway to the next one
    int lower = min(int(roughness / step), 2 * last - 1), even = (lower + 1) / 2, odd = lower / 2;
    vec3 at_even = even < sharp_levels ? textureLod(specular, d, float(even)).rgb
                                       : textureLod(rough, d, float(even - sharp_levels)).rgb;
    vec3 at_odd = odd < sharp_levels ? textureLod(between, d, float(odd)).rgb
                                     : textureLod(rough_between, d, float(odd - sharp_levels)).rgb;
    float narrow = lobe_narrowness(float(lower) * step), wide = lobe_narrowness(float(lower + 1) * step);
    float weight = clamp((narrow - lobe_narrowness(roughness)) / (narrow - wide), 0.0, 1.0);
    return mix(at_even, at_odd, (lower & 1) == 0 ? weight : 1.0 - weight);
}

// `lobe` above 1: irradiance / π; 0 to 1: a specular lobe of this roughness; below 0: the mean over an angle of -lobe
// radians.
vec3 light_from(vec3 direction, float lobe) {
    vec3 d = world_to_environment(direction);
    vec3 radiance;
    if (lobe > 1.0) radiance = diffuse_light(d);
    else if (lobe >= 0.0) radiance = specular_light(d, lobe);
    else radiance = equirectangular_radiance(map, d, -lobe);
    return radiance * environment_transform.z;
}
