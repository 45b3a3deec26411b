// Where rays from the surface at a texel begin.
#include <depth_surface.glsl>
#include <ray_directions.glsl>

// The origin of rays that leave `position`, the position of a texel with the unit shading normal `axis`. It lies above
// the surface by more than the error of positions from depth, and as far towards the viewer: in a crease, the error can
// put a position behind the other surface, but the line to the viewer is free.
vec3 ray_origin(ivec2 texel, vec3 position, vec3 axis, float window_depth) {
    vec3 geometric_normal = geometric_normal_at(texel, TEXEL_CENTER, position, window_depth);
    // At outlines, differences of depth are between two surfaces.
    if (dot(geometric_normal, axis) < 0.25) geometric_normal = axis;
    float distance = linear_depth(depth_views[0], window_depth);
    float offset = max(ray_offset(position, distance), snapped_by(distance));
    return position + offset * (geometric_normal + view_dir(depth_views[0], position));
}
