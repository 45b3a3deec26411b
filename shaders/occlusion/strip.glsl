// The strip of a surface that a sample stands for: from halfway to the previous sample to halfway to the next one, and
// `thickness` deep (O. Therrien, Y. Levesque and G. Gilet, "Screen Space Indirect Lighting with Visibility Bitmask",
// 2023).

// The view rays along a direction on the screen. Origin and direction change linearly with the distance from the pixel,
// as a fraction of the search radius.
struct ViewRays {
    vec3 origin;
    vec3 origin_change;
    vec3 direction;
    vec3 direction_change;
};

ViewRays view_rays(View v, vec2 uv, vec2 radius_uv) {
    vec3 start = view_position(v, uv, 1.0);
    vec3 change = view_position(v, uv + radius_uv, 1.0) - start;
    if (v.projection[2][3] == 0.0) return ViewRays(start, change, vec3(0.0, 0.0, -1.0), vec3(0.0));
    return ViewRays(vec3(0.0), vec3(0.0), start, change);
}

// Where the tangent plane of a sample intersects the view ray at another fraction of the radius. Takes and returns an
// offset from the pixel; returns the sample's own if the plane is nearly parallel to the ray, or the result farther
// from it than the pixel is.
vec3 extend_plane(ViewRays rays, float fraction, vec3 position, vec3 offset, vec3 normal) {
    vec3 origin = rays.origin + fraction * rays.origin_change - position;
    vec3 direction = rays.direction + fraction * rays.direction_change;
    float slope = dot(normal, direction);
    vec3 extended = origin + direction * (dot(normal, offset - origin) / slope);
    vec3 difference = extended - offset;
    return abs(slope) > 1e-4 && dot(difference, difference) < dot(offset, offset) ? extended : offset;
}

// The cosine of the angle between an offset and the view direction.
float cos_to_viewer(vec3 offset, vec3 view_dir) {
    return dot(offset, view_dir) * inversesqrt(max(dot(offset, offset), 1e-20));
}

// The cosines of the angles to the view direction between which a pixel sees a strip: x of its back, y of its front.
//
// Args: the fractions of the radius where the strip begins and ends, the pixel's position, the sample's offset from it
// and its normal, the view direction, and the thickness in metres.
vec2 strip_cosines(
    ViewRays rays, float begin, float end, vec3 position, vec3 offset, vec3 normal, vec3 view_dir, float thickness
) {
    vec3 sample_position = position + offset;
    vec3 ray = rays.direction_change == vec3(0.0)
        ? rays.direction : sample_position * inversesqrt(dot(sample_position, sample_position));
    float cos_middle = cos_to_viewer(offset, view_dir);
    float cos_begin = cos_to_viewer(extend_plane(rays, begin, position, offset, normal), view_dir);
    float cos_end = cos_to_viewer(extend_plane(rays, end, position, offset, normal), view_dir);
    float cos_back = cos_to_viewer(offset + ray * thickness, view_dir);
    return clamp(vec2(min(min(cos_middle, cos_begin), cos_back), max(cos_middle, cos_end)), -1.0, 1.0);
}
