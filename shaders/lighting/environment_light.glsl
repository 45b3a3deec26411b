// Light from all around: nine harmonics for diffuse surfaces, levels of a prefiltered cube for what mirrors, and the
// picture itself for what is seen of it.
#include <environment.glsl>
#include <equirectangular.glsl>

uniform sampler2D map;
uniform samplerCube specular;  // levels of even roughness from 0 on,
uniform samplerCube rough;     // and on to 1
uniform samplerCube between;   // levels halfway between those
uniform samplerCube rough_between;
uniform sampler2D harmonics;

vec4 constant(int number) {
    return texelFetch(harmonics, ivec2(number, 0), 0);
}

vec3 diffuse_light(vec3 d) {
    vec4 linear = vec4(d, 1.0), products = vec4(d.x * d.y, d.y * d.z, d.z * d.z, d.x * d.z);
    vec3 sum = constant(15).rgb * (d.x * d.x - d.y * d.y);
    for (int c = 0; c < 3; ++c) sum[c] += dot(constant(9 + c), linear) + dot(constant(12 + c), products);
    return max(sum, 0.0);
}

// A measure of how narrow a lobe is. Its peak goes with the fourth power of 1 / roughness; the third power leaves the
// least error at the peak and on its slopes together. The constant keeps it finite for mirrors.
float lobe_narrowness(float roughness) {
    return 1.0 / (roughness * roughness * roughness + 1.25e-4);
}

// Radiance of a mirrored lobe, interpolated between the two nearest levels. The weights are linear in the lobe's
// narrowness and not in roughness: otherwise highlights of small lights would be far too bright between two levels.
vec3 mirrored_light(vec3 d, float roughness) {
    int sharp = textureQueryLevels(specular), last = sharp + textureQueryLevels(rough) - 1;
    float step = 0.5 / float(last);  // of roughness, between a level of `specular` or `rough` and one between
    int below = min(int(roughness / step), 2 * last - 1), even = (below + 1) / 2, odd = below / 2;
    vec3 at_even =
        even < sharp ? textureLod(specular, d, float(even)).rgb : textureLod(rough, d, float(even - sharp)).rgb;
    vec3 at_odd =
        odd < sharp ? textureLod(between, d, float(odd)).rgb : textureLod(rough_between, d, float(odd - sharp)).rgb;
    float narrow = lobe_narrowness(float(below) * step), wide = lobe_narrowness(float(below + 1) * step);
    float share = clamp((narrow - lobe_narrowness(roughness)) / (narrow - wide), 0.0, 1.0);
    return mix(at_even, at_odd, (below & 1) == 0 ? share : 1.0 - share);
}

vec3 light_from(vec3 direction, float lobe) {
    vec3 d = world_to_environment(direction);
    vec3 light;
    if (lobe > 1.0) light = diffuse_light(d);
    else if (lobe >= 0.0) light = mirrored_light(d, lobe);
    else light = equirectangular_radiance(map, d, -lobe);
    return light * environment_transform.z;
}
