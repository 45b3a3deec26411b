// What is around, in cells of a cube: the mean radiance of each, and where in it the light is, such as a sun.
#include <cube.glsl>
#include <equirectangular.glsl>
#include <luminance.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D map;  // equirectangular
uniform writeonly image2DArray cells;
uniform writeonly image2DArray leaning;

void main() {
    ivec3 cell = ivec3(gl_GlobalInvocationID);
    int side = imageSize(cells).x;
    if (any(greaterThanEqual(cell.xy, ivec2(side)))) return;
    vec3 sum = vec3(0.0), lean = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 place = cube_texel_center(2 * cell.xy + ivec2(i & 1, i >> 1), 2 * side);
        vec3 direction = cube_direction(cell.z, place);
        vec3 light = equirectangular_radiance(map, direction, sqrt(cube_solid_angle(place, 2 * side)));
        sum += light;
        // As places of the face, so that of even light it is the middle; in the dark, too.
        vec3 away = abs(direction);
        lean += (luminance_of(light) + 1e-3) * direction / max(away.x, max(away.y, away.z));
    }
    imageStore(cells, cell, vec4(0.25 * sum, 1.0));
    imageStore(leaning, cell, vec4(0.25 * lean, 0.0));
}
