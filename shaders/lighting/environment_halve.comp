// Four cells in one: the level below of both of their pictures.
layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2DArray cells;
uniform sampler2DArray leaning;
uniform writeonly image2DArray fewer_cells;
uniform writeonly image2DArray fewer_leaning;

vec4 mean_of(sampler2DArray fine, ivec3 cell) {
    ivec3 at = ivec3(2 * cell.xy, cell.z);
    return 0.25 * (texelFetch(fine, at, 0) + texelFetch(fine, at + ivec3(1, 0, 0), 0)
        + texelFetch(fine, at + ivec3(0, 1, 0), 0) + texelFetch(fine, at + ivec3(1, 1, 0), 0));
}

void main() {
    ivec3 cell = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(cell.xy, imageSize(fewer_cells).xy))) return;
    imageStore(fewer_cells, cell, mean_of(cells, cell));
    imageStore(fewer_leaning, cell, mean_of(leaning, cell));
}
