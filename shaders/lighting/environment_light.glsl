// Light from all around: nine harmonics for diffuse surfaces, levels of a prefiltered cube for what mirrors, and the
// picture itself for what is seen of it.
#include <environment.glsl>
#include <equirectangular.glsl>

uniform sampler2D map;
uniform samplerCube specular;  // levels of even roughness, from 0 to 1
uniform samplerCube between;   // levels halfway between those
layout(std430) readonly buffer harmonics {
    vec4 bands[16];
};

vec3 diffuse_light(vec3 d) {
    vec4 linear = vec4(d, 1.0), products = vec4(d.x * d.y, d.y * d.z, d.z * d.z, d.x * d.z);
    vec3 sum = bands[15].rgb * (d.x * d.x - d.y * d.y);
    for (int c = 0; c < 3; ++c) sum[c] += dot(bands[9 + c], linear) + dot(bands[12 + c], products);
    return max(sum, 0.0);
}

vec3 mirrored_light(vec3 d, float roughness) {
    int last = textureQueryLevels(specular) - 1;
    float place = 2.0 * float(last) * roughness;  // whole numbers are levels: even ones of `specular`
    int below = int(place);
    float share = (below & 1) == 0 ? fract(place) : 1.0 - fract(place);
    vec3 even = textureLod(specular, d, float((below + 1) / 2)).rgb;
    return mix(even, textureLod(between, d, float(min(below / 2, last - 1))).rgb, share);
}

vec3 light_from(vec3 direction, float lobe) {
    vec3 d = in_environment(direction);
    vec3 light;
    if (lobe > 1.0) light = diffuse_light(d);
    else if (lobe >= 0.0) light = mirrored_light(d, lobe);
    else light = picture_radiance(map, d, -lobe);
    return light * environment_turn.z;
}
