// One level of a prefiltered cube map: what `environment_specular.comp` samples, integrated over the whole environment.
// The environment is read as a quadtree of cube map cells, which is refined where the lobe is steep. Each cell emits
// from the mean direction of its light, so a sun keeps its direction even in a much larger cell. Each invocation
// computes 2 × 2 texels with a single traversal.
#include <cube.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2DArray cells;             // mean radiance, with all levels; the last has 1 << COARSEST cells per side
uniform sampler2DArray light_directions;  // directions weighted by luminance, likewise
uniform float roughness;                  // perceptual
uniform writeonly imageCube specular;

const int COARSEST = 2;  // log2 of the number of cells along a side of a face, at the coarsest level

// GGX lobes around four normals, seen along the normal, times NoL, up to a factor.
vec4 ggx_lobes(vec4 NoL, float a2) {
    NoL = max(NoL, 0.0);
    vec4 d = 0.5 * (1.0 + a2) - 0.5 * (1.0 - a2) * NoL;
    return NoL / (d * d);
}

// Solid angle per area on the face of a cube map, in a direction.
float face_jacobian(vec3 direction) {
    vec3 magnitude = abs(direction);
    float major = max(magnitude.x, max(magnitude.y, magnitude.z));
    return major * major * major;
}

// Every second bit, which decodes one coordinate of a Morton code.
int even_bits(int bits) {
    bits &= 0x55555555;
    bits = (bits | bits >> 1) & 0x33333333;
    bits = (bits | bits >> 2) & 0x0f0f0f0f;
    bits = (bits | bits >> 4) & 0x00ff00ff;
    return (bits | bits >> 8) & 0xffff;
}

void main() {
    ivec3 block = ivec3(gl_GlobalInvocationID);
    int size = imageSize(specular).x;
    if (any(greaterThanEqual(2 * block.xy, ivec2(size)))) return;
    vec3 center = cube_direction(block.z, (4.0 * vec2(block.xy) + 2.0) / float(size) - 1.0);
    vec4 x, y, z;  // components of the four normals
    for (int k = 0; k < 4; ++k) {
        vec3 normal = cube_direction(block.z, cube_texel_center(2 * block.xy + ivec2(k & 1, k >> 1), size));
        x[k] = normal.x;
        y[k] = normal.y;
        z[k] = normal.z;
    }
    float block_radius = 1.4 / float(size), a2 = roughness * roughness * roughness * roughness;
    int finest = textureQueryLevels(cells) - 1 + COARSEST;
    // Largest size of a cell relative to the angle in which the lobe falls off. Levels of narrow lobes have many
    // texels, so they use coarser cells.
    float steepness = roughness < 0.25 ? 0.65 : 0.4;
    int min_level = COARSEST + (roughness < 0.45 ? 0 : 1);  // levels of wide lobes have few texels, which may cost more
    vec4 red = vec4(0.0), green = vec4(0.0), blue = vec4(0.0), weights = vec4(0.0);
    int level = COARSEST, index = 0;  // a level has 1 << level cells per side; the index is the face and a Morton code
    while (index < 6 << (2 * level)) {
        int morton = index & ((1 << (2 * level)) - 1), face = index >> (2 * level);
        ivec2 cell = ivec2(even_bits(morton), even_bits(morton >> 1));
        vec3 direction = cube_direction(face, cube_texel_center(cell, 1 << level));
        float area = face_jacobian(direction) / float(1 << (2 * level));
        float cosine = dot(center, direction), width2 = 4.0 * area, margin = 0.75 * sqrt(width2) + block_radius;
        bool is_visible = cosine > -margin;
        float angle = max(sqrt(max(2.0 - 2.0 * cosine, 0.0)) - block_radius, 0.0);
        bool is_coarse = width2 > steepness * steepness * (4.0 * a2 + angle * angle);
        if (is_visible && level < finest && (is_coarse || level < min_level)) {
            level += 1;
            index <<= 2;
            continue;
        }
        if (is_visible) {
            ivec3 texel = ivec3(cell, face);
            vec3 radiance = texelFetch(cells, texel, finest - level).rgb;
            vec3 light_dir = normalize(texelFetch(light_directions, texel, finest - level).xyz);
            float light_area = face_jacobian(light_dir) / float(1 << (2 * level));
            vec4 weight = ggx_lobes(x * light_dir.x + y * light_dir.y + z * light_dir.z, a2) * light_area;
            red += weight * radiance.r;
            green += weight * radiance.g;
            blue += weight * radiance.b;
            weights += ggx_lobes(x * direction.x + y * direction.y + z * direction.z, a2) * area;
        }
        index += 1;
        while (level > COARSEST && (index & 3) == 0) {
            index >>= 2;
            level -= 1;
        }
    }
    for (int k = 0; k < 4; ++k) {
        ivec2 texel = 2 * block.xy + ivec2(k & 1, k >> 1);
        vec3 mean = vec3(red[k], green[k], blue[k]) / weights[k];
        if (all(lessThan(texel, ivec2(size)))) imageStore(specular, ivec3(texel, block.z), vec4(mean, 1.0));
    }
}
