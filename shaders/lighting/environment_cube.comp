// Converts an equirectangular environment map to a cube map.
#include <cube.glsl>
#include <equirectangular.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D map;  // equirectangular
uniform writeonly imageCube cube;

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int size = imageSize(cube).x;
    if (any(greaterThanEqual(texel.xy, ivec2(size)))) return;
    // Four samples per texel: with one, a sun of a single texel of the map would be weighted too much or too little.
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 position = cube_texel_center(2 * texel.xy + ivec2(i & 1, i >> 1), 2 * size);
        float angle = sqrt(cube_solid_angle(position, 2 * size));
        sum += equirectangular_radiance(map, cube_direction(texel.z, position), angle);
    }
    imageStore(cube, texel, vec4(0.25 * sum, 1.0));
}
