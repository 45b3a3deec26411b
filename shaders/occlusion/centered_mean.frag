// The bilateral mean over 4×4 pixels for values that are interpolated or filtered further. Its kernel is centred on the
// pixel and preserves gradients; that of `block_mean.frag` is off by half a pixel and turns them into steps. Each quad
// of 2×2 pixels already holds its own mean. The kernel has 3×3 quads, with weights along each axis of one half for the
// centre, 3/8 for the nearer neighbour and 1/8 for the other. All pixels of a quad need the same nine quads, so each
// fetches four and takes the rest from its neighbours.
#include "surfaces.glsl"
#include "outputs.glsl"
#include "quad_swap.glsl"
uniform sampler2D unfiltered;
uniform sampler2D surfaces;
uniform ivec2 screen_size;
uniform float radius;  // of occlusion, in metres

SurfaceSample fetch_sample(View view, ivec2 pixel, ivec2 size) {
    ivec2 target = target_size(size);
    ivec2 clamped = clamp(pixel, ivec2(0), target - 1);
    ivec2 texel = surface_texel(clamped, size);
    vec4 surface = fetch_texel(surfaces, texel, size);
    vec3 normal = clamped == pixel ? surface.xyz : vec3(0.0);
    return SurfaceSample(view_position(view, texel_uv(texel, size, screen_size), surface.w), normal,
                         fetch_texel(unfiltered, clamped, target).VALUE_CHANNELS);
}

void add(inout Value sum, inout float total_weight, SurfaceSample center, SurfaceSample s, float kernel,
         float tolerance) {
    float weight = kernel * bilateral_weight(s.position - center.position, center.normal, s.normal, tolerance);
    sum += weight * s.value;
    total_weight += weight;
}

void main() {
    View view = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec2 side = vec2(1 - 2 * (pixel & 1));     // towards the other pixels of the quad
    ivec2 quad_offset = -2 * ivec2(side);      // towards the nearer neighbouring quads
    SurfaceSample center = fetch_sample(view, pixel, size);
    SurfaceSample horizontal = fetch_sample(view, pixel + ivec2(quad_offset.x, 0), size);
    SurfaceSample vertical = fetch_sample(view, pixel + ivec2(0, quad_offset.y), size);
    SurfaceSample diagonal = fetch_sample(view, pixel + quad_offset, size);
    SurfaceSample swapped_diagonal = swap_vertical(diagonal, side.y);
    float tolerance = 0.1 * radius + depth_error(view, -center.position.z);
    float total_weight = 0.25;
    Value sum = total_weight * center.value;
    add(sum, total_weight, center, horizontal, 0.1875, tolerance);
    add(sum, total_weight, center, swap_horizontal(horizontal, side.x), 0.0625, tolerance);
    add(sum, total_weight, center, vertical, 0.1875, tolerance);
    add(sum, total_weight, center, swap_vertical(vertical, side.y), 0.0625, tolerance);
    add(sum, total_weight, center, diagonal, 0.140625, tolerance);
    add(sum, total_weight, center, swap_horizontal(diagonal, side.x), 0.046875, tolerance);
    add(sum, total_weight, center, swapped_diagonal, 0.046875, tolerance);
    add(sum, total_weight, center, swap_horizontal(swapped_diagonal, side.x), 0.015625, tolerance);
    write_outputs(center.position.z < 0.0 ? sum / total_weight : OPEN_VALUE);
}
