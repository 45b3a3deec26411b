// One level of a prefiltered cube map: the mean of the radiance around each direction over GGX's lobe, seen along the
// normal and weighted by N.L (Karis 2013). Each sample reads the level of the source whose texels are as large as what
// the sample stands for (Colbert and Krivanek 2007). All texels take the same samples, so a group works them out once.
#include <brdf.glsl>
#include <cube.glsl>
#include <hammersley.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform samplerCube cube;  // the environment, with all its levels
uniform float roughness;   // perceptual, above 0
uniform float level_bias;
uniform writeonly imageCube specular;

shared vec4 samples[SAMPLES];  // direction about +Z, level; those below the horizon count for nothing

void work_out_samples() {
    float alpha = roughness * roughness;
    float texel = 4.0 * PI / (6.0 * pow(float(textureSize(cube, 0).x), 2.0));
    for (int i = int(gl_LocalInvocationIndex); i < SAMPLES; i += 64) {
        vec3 h = ggx_half_vector(hammersley(i, SAMPLES), alpha);
        vec3 to_light = vec3(2.0 * h.z * h.xy, 2.0 * h.z * h.z - 1.0);
        float density = 0.25 * distribution_ggx(h.z, alpha);
        float level = level_bias + 0.5 * log2(1.0 / (float(SAMPLES) * density * texel));
        samples[i] = vec4(to_light, max(level, 0.0));
    }
    barrier();
}

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int side = imageSize(specular).x;
    vec3 normal = cube_direction(texel.z, cube_texel_center(texel.xy, side));
    vec3 sum = vec3(0.0);
    work_out_samples();
    vec3 tangent = any_tangent(normal);
    mat3 frame = mat3(tangent, cross(normal, tangent), normal);
    float weights = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        vec4 one = samples[i];
        if (one.z <= 0.0) continue;
        sum += textureLod(cube, frame * one.xyz, one.w).rgb * one.z;
        weights += one.z;
    }
    sum /= weights;
    if (all(lessThan(texel.xy, ivec2(side)))) imageStore(specular, texel, vec4(sum, 1.0));
}
