// Averages 2 × 2 cells of the environment into one, for the next mip level.
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2DArray cells;
uniform sampler2DArray light_directions;
uniform writeonly image2DArray coarse_cells;
uniform writeonly image2DArray coarse_light_directions;

vec4 mean_of(sampler2DArray level, ivec3 cell) {
    ivec3 first = ivec3(2 * cell.xy, cell.z);
    return 0.25 * (texelFetch(level, first, 0) + texelFetch(level, first + ivec3(1, 0, 0), 0)
        + texelFetch(level, first + ivec3(0, 1, 0), 0) + texelFetch(level, first + ivec3(1, 1, 0), 0));
}

void main() {
    ivec3 cell = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(cell.xy, imageSize(coarse_cells).xy))) return;
    imageStore(coarse_cells, cell, mean_of(cells, cell));
    imageStore(coarse_light_directions, cell, mean_of(light_directions, cell));
}
