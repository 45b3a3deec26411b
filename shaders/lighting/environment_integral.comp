// One level of a prefiltered cube map: what `environment_specular.comp` samples, summed over all of the picture. The
// picture is taken in cells of a cube, the smaller the steeper the lobe is there, and each cell shines from where its
// light is: a sun stays where it stands, so that cells may be much larger than it. Four texels go the same way down
// through the cells, which are so looked up once for all four.
#include <cube.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2DArray cells;    // mean radiance, with all levels; the last has COARSE cells along a side of a face
uniform sampler2DArray leaning;  // directions weighted by luminance, likewise
uniform float roughness;         // perceptual
uniform writeonly imageCube specular;

const int COARSE = 2;  // bits of the side of the coarsest level

// GGX's lobe around four normals, seen along them, times N.L; but for a factor.
vec4 lobes(vec4 NoL, float a2) {
    NoL = max(NoL, 0.0);
    vec4 fall = 0.5 * (1.0 + a2) - 0.5 * (1.0 - a2) * NoL;
    return NoL / (fall * fall);
}

// A face's area around a direction, over the solid angle.
float squeezed(vec3 direction) {
    vec3 size = abs(direction);
    float major = max(size.x, max(size.y, size.z));
    return major * major * major;
}

// Every second bit.
int halved_bits(int bits) {
    bits &= 0x55555555;
    bits = (bits | bits >> 1) & 0x33333333;
    bits = (bits | bits >> 2) & 0x0f0f0f0f;
    bits = (bits | bits >> 4) & 0x00ff00ff;
    return (bits | bits >> 8) & 0xffff;
}

void main() {
    ivec3 block = ivec3(gl_GlobalInvocationID);
    int side = imageSize(specular).x;
    if (any(greaterThanEqual(2 * block.xy, ivec2(side)))) return;
    vec3 middle = cube_direction(block.z, (4.0 * vec2(block.xy) + 2.0) / float(side) - 1.0);
    vec4 x, y, z;
    for (int k = 0; k < 4; ++k) {
        vec3 normal = cube_direction(block.z, cube_texel_center(2 * block.xy + ivec2(k & 1, k >> 1), side));
        x[k] = normal.x;
        y[k] = normal.y;
        z[k] = normal.z;
    }
    float radius = 1.4 / float(side), a2 = roughness * roughness * roughness * roughness;
    int finest = textureQueryLevels(cells) - 1 + COARSE;
    // A cell's side over the angle in which the lobe falls; levels of narrow lobes have many texels.
    float steepness = roughness < 0.25 ? 0.65 : 0.4;
    int least = COARSE + (roughness < 0.45 ? 0 : 1);  // levels of wide lobes have few texels, which may take longer
    vec4 red = vec4(0.0), green = vec4(0.0), blue = vec4(0.0), weights = vec4(0.0);
    int bits = COARSE, at = 0;  // cells of 1 << bits along a side; the number of one, along a curve of quarters
    while (at < 6 << (2 * bits)) {
        int number = at & ((1 << (2 * bits)) - 1), face = at >> (2 * bits);
        ivec2 cell = ivec2(halved_bits(number), halved_bits(number >> 1));
        vec3 direction = cube_direction(face, cube_texel_center(cell, 1 << bits));
        float area = squeezed(direction) / float(1 << (2 * bits));
        float cosine = dot(middle, direction), width2 = 4.0 * area, reach = 0.75 * sqrt(width2) + radius;
        bool seen = cosine > -reach;
        float away = max(sqrt(max(2.0 - 2.0 * cosine, 0.0)) - radius, 0.0);
        bool coarse = width2 > steepness * steepness * (4.0 * a2 + away * away);
        if (seen && bits < finest && (coarse || bits < least)) {
            bits += 1;
            at <<= 2;
            continue;
        }
        if (seen) {
            ivec3 texel = ivec3(cell, face);
            vec3 radiance = texelFetch(cells, texel, finest - bits).rgb;
            vec3 light = normalize(texelFetch(leaning, texel, finest - bits).xyz);
            float part = squeezed(light) / float(1 << (2 * bits));
            vec4 share = lobes(x * light.x + y * light.y + z * light.z, a2) * part;
            red += share * radiance.r;
            green += share * radiance.g;
            blue += share * radiance.b;
            weights += lobes(x * direction.x + y * direction.y + z * direction.z, a2) * area;
        }
        at += 1;
        while (bits > COARSE && (at & 3) == 0) {
            at >>= 2;
            bits -= 1;
        }
    }
    for (int k = 0; k < 4; ++k) {
        ivec2 texel = 2 * block.xy + ivec2(k & 1, k >> 1);
        vec3 mean = vec3(red[k], green[k], blue[k]) / weights[k];
        if (all(lessThan(texel, ivec2(side)))) imageStore(specular, ivec3(texel, block.z), vec4(mean, 1.0));
    }
}
