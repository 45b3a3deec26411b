// Marks reduced values that must not be interpolated with -1: those whose second difference along an axis, which is 0
// for gradients, exceeds `contrast`. At the edge of a plane, the value is mirrored. Differences span two pixels,
// because closer ones share samples; narrower planes have no difference and are marked.
#include "surfaces.glsl"
#include "value.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform float radius;    // of occlusion, in metres
uniform float contrast;  // of ambient visibility
out Value marked;

void main() {
    View view = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = current_surface_texel(size);
    vec4 surface = fetch_texel(surfaces, texel, size);
    vec3 position = view_position(view, texel_uv(texel, size, size), surface.w);
    float tolerance = 0.1 * radius + depth_error(view, surface.w);
    marked = fetch_texel(source, pixel, reduced_size).VALUE_CHANNELS;
    float visibility = ambient_visibility(marked);
    vec2 difference = vec2(0.0);  // the sum of both sides of each axis
    vec2 side_count = vec2(0.0);
    int count = surface.w > 0.0 ? 4 : 0;
    for (int i = 0; i < count; ++i) {
        ivec2 axis = ivec2(i & 1, ~i & 1);
        ivec2 neighbor = pixel + 2 * ((i & 2) - 1) * axis;
        ivec2 clamped = clamp(neighbor, ivec2(0), reduced_size - 1);
        ivec2 sample_texel = surface_texel(clamped, size);
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        vec3 offset = view_position(view, texel_uv(sample_texel, size, size), sample_surface.w) - position;
        bool on_surface = clamped == neighbor && is_coplanar(offset, surface.xyz, sample_surface.xyz, tolerance);
        vec2 weight = on_surface ? vec2(axis) : vec2(0.0);
        float neighbor_visibility = ambient_visibility(fetch_texel(source, clamped, reduced_size).VALUE_CHANNELS);
        difference += weight * (neighbor_visibility - visibility);
        side_count += weight;
    }
    vec2 curvature = abs(difference) * 2.0 / max(side_count, 1.0);
    bool is_narrow = min(side_count.x, side_count.y) == 0.0;
    if (is_narrow || max(curvature.x, curvature.y) > contrast) marked = Value(-1.0);
}
