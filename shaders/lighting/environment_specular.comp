// One level of a prefiltered cube map: radiance averaged over the GGX lobe around each direction, seen along the normal
// and weighted by NoL (Karis 2013). Each sample reads the mip level whose texels are as large as the solid angle that
// the sample represents (Colbert and Krivanek 2007). All texels use the same samples, so each group computes them once.
#include <brdf.glsl>
#include <cube.glsl>
#include <hammersley.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform samplerCube cube;  // the environment, with all mip levels
uniform float roughness;   // perceptual, above 0
uniform float level_bias;
uniform writeonly imageCube specular;

shared vec4 samples[SAMPLES];  // direction in tangent space, mip level; directions below the horizon are skipped

void compute_samples() {
    float alpha = roughness * roughness;
    float texel_solid_angle = 4.0 * PI / (6.0 * pow(float(textureSize(cube, 0).x), 2.0));
    for (int i = int(gl_LocalInvocationIndex); i < SAMPLES; i += 64) {
        vec3 h = ggx_half_vector(hammersley(i, SAMPLES), alpha);
        vec3 light_dir = vec3(2.0 * h.z * h.xy, 2.0 * h.z * h.z - 1.0);
        float pdf = 0.25 * distribution_ggx(h.z, alpha);
        float level = level_bias + 0.5 * log2(1.0 / (float(SAMPLES) * pdf * texel_solid_angle));
        samples[i] = vec4(light_dir, max(level, 0.0));
    }
    barrier();
}

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int size = imageSize(specular).x;
    vec3 normal = cube_direction(texel.z, cube_texel_center(texel.xy, size));
    vec3 sum = vec3(0.0);
    compute_samples();
    vec3 tangent = any_tangent(normal);
    mat3 tangent_to_world = mat3(tangent, cross(normal, tangent), normal);
    float weights = 0.0;
    for (int i = 0; i < SAMPLES; ++i) {
        vec4 direction = samples[i];
        if (direction.z <= 0.0) continue;
        sum += textureLod(cube, tangent_to_world * direction.xyz, direction.w).rgb * direction.z;
        weights += direction.z;
    }
    sum /= weights;
    if (all(lessThan(texel.xy, ivec2(size)))) imageStore(specular, texel, vec4(sum, 1.0));
}
