// The environment in cells of a cube map: the mean radiance of each cell, and the mean direction of its light, which
// points at a small bright light such as the sun.
#include <cube.glsl>
#include <equirectangular.glsl>
#include <luminance.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D map;  // equirectangular
uniform writeonly image2DArray cells;
uniform writeonly image2DArray light_directions;

void main() {
    ivec3 cell = ivec3(gl_GlobalInvocationID);
    int size = imageSize(cells).x;
    if (any(greaterThanEqual(cell.xy, ivec2(size)))) return;
    vec3 radiance_sum = vec3(0.0), direction_sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 position = cube_texel_center(2 * cell.xy + ivec2(i & 1, i >> 1), 2 * size);
        vec3 direction = cube_direction(cell.z, position);
        vec3 radiance = equirectangular_radiance(map, direction, sqrt(cube_solid_angle(position, 2 * size)));
        radiance_sum += radiance;
        // Directions are scaled to the face, so that uniform light, and darkness, yield the centre of the cell.
        vec3 magnitude = abs(direction);
        float major = max(magnitude.x, max(magnitude.y, magnitude.z));
        direction_sum += (luminance_of(radiance) + 1e-3) * direction / major;
    }
    imageStore(cells, cell, vec4(0.25 * radiance_sum, 1.0));
    imageStore(light_directions, cell, vec4(0.25 * direction_sum, 0.0));
}
