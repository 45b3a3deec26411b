// A picture of everything around, as a cube map.
#include <cube.glsl>
#include <equirectangular.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D map;  // equirectangular
uniform writeonly imageCube cube;

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int side = imageSize(cube).x;
    if (any(greaterThanEqual(texel.xy, ivec2(side)))) return;
    // Four samples a texel: a sun of one texel of the picture would otherwise count too much or too little.
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 place = cube_texel_center(2 * texel.xy + ivec2(i & 1, i >> 1), 2 * side);
        sum += equirectangular_radiance(map, cube_direction(texel.z, place), sqrt(cube_solid_angle(place, 2 * side)));
    }
    imageStore(cube, texel, vec4(0.25 * sum, 1.0));
}
