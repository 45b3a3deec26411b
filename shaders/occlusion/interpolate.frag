// Interpolates reduced values at full size where that is as good as computing them: at pixels with reduced ones on
// their own surface, none of which is marked by `curvature.frag`. For all other pixels it writes depth 0 as a mask, as
// `interpolate_contrast.frag` does.
#include "surfaces.glsl"
#include "outputs.glsl"
#include "quad_swap.glsl"
uniform sampler2D source;  // reduced; ambient visibility is below 0 where it must not be interpolated
uniform sampler2D surfaces;
uniform float radius;      // of occlusion, in metres
out Value interpolated;    // for the passes that filter the masked pixels

struct Interpolation {
    Value sum;
    float total_weight;
    bool has_marked;
};

void add(inout Interpolation result, vec3 position, vec3 normal, SurfaceSample s, float bilinear, float tolerance) {
    float weight = is_coplanar(s.position - position, normal, s.normal, tolerance) ? bilinear : 0.0;
    result.sum += weight * s.value;
    result.total_weight += weight;
    result.has_marked = result.has_marked || weight > 0.0 && ambient_visibility(s.value) < -0.5;
}

void main() {
    View view = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 screen_size = textureSize(surfaces, 0);
    ivec2 size = textureSize(source, 0);
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec3 position = view_position(view, (vec2(texel) + 0.5) / vec2(screen_size), surface.w);
    float tolerance = 0.1 * radius + depth_error(view, surface.w);
    // All four pixels of a quad lie between the same four reduced ones: each fetches one of them.
    ivec2 odd = texel & 1;
    ivec2 first = ivec2(ceil(vec2(texel - odd + 1) * vec2(size) / vec2(screen_size) - 0.5)) - 1;
    ivec2 own = clamp(first + odd, ivec2(0), size - 1);
    ivec2 own_texel = full_size_texel(own, size, screen_size);
    vec2 opposite_texel = vec2(full_size_texel(clamp(first + 1 - odd, ivec2(0), size - 1), size, screen_size));
    vec2 own_weight = clamp((opposite_texel - vec2(texel)) / (opposite_texel - vec2(own_texel)), 0.0, 1.0);
    own_weight = mix(own_weight, vec2(1.0), equal(opposite_texel, vec2(own_texel)));  // at the picture's edge
    vec2 opposite_weight = 1.0 - own_weight;
    vec4 own_surface = fetch_texel(surfaces, own_texel, screen_size);
    SurfaceSample s = SurfaceSample(
        view_position(view, (vec2(own_texel) + 0.5) / vec2(screen_size), own_surface.w), own_surface.xyz,
        fetch_texel(source, own, size).VALUE_CHANNELS);
    vec2 side = vec2(1 - 2 * odd);
    SurfaceSample vertical = swap_vertical(s, side.y);
    Interpolation result = Interpolation(Value(0.0), 0.0, false);
    add(result, position, surface.xyz, s, own_weight.x * own_weight.y, tolerance);
    add(result, position, surface.xyz, swap_horizontal(s, side.x), opposite_weight.x * own_weight.y, tolerance);
    add(result, position, surface.xyz, vertical, own_weight.x * opposite_weight.y, tolerance);
    add(result, position, surface.xyz, swap_horizontal(vertical, side.x), opposite_weight.x * opposite_weight.y,
        tolerance);
    // Masks whole quads, because their pixels share samples.
    float mask = surface.w > 0.0 && (result.has_marked || result.total_weight < 1e-3) ? 1.0 : 0.0;
    mask = max(mask, mask + side.x * dFdxFine(mask));
    mask = max(mask, mask + side.y * dFdyFine(mask));
    interpolated = result.total_weight > 0.0 ? result.sum / result.total_weight : OPEN_VALUE;
    write_outputs(interpolated);
    gl_FragDepth = 1.0 - mask;
}
