// A slice of a pixel's hemisphere: the half plane through the view direction and a direction on the screen, with its
// opposite (J. Jimenez et al., "Practical Real-Time Strategies for Accurate Indirect Occlusion", 2016). Angles are
// measured from the view direction. A direction in the slice is given by the cosine of its angle and its side, 1
// towards the direction on the screen and -1 away from it; all but one term of the paper's integrals follow from those
// without a trigonometric function.
struct Slice {
    vec3 view_dir;           // unit
    vec3 tangent;            // unit, orthogonal to the view direction, towards the direction on the screen
    float normal_angle;      // of the normal projected into the slice
    float cos_normal;        // of that angle
    float sin_normal;
    float projected_length;  // of the normal: the weight of the slice
    float full_integral;     // cosine-weighted, of both sides down to the tangent plane
};

Slice make_slice(vec2 direction, vec3 view_dir, vec3 normal) {
    vec3 tangent = cross(view_dir, normalize(cross(vec3(direction, 0.0), view_dir)));
    vec2 projected = vec2(dot(normal, view_dir), dot(normal, tangent));
    float projected_length = max(length(projected), 1e-6);
    float angle = atan(projected.y, projected.x);
    vec2 unit = projected / projected_length;
    return Slice(view_dir, tangent, angle, unit.x, unit.y, projected_length, unit.x + angle * unit.y);
}

// The cosine of the angle between the view direction and the tangent plane on a side.
float cos_tangent_plane(Slice s, float side) {
    return -side * s.sin_normal;
}

// The cosine-weighted integral of a side from the view direction to a horizon.
float horizon_integral(Slice s, float cos_horizon, float side) {
    float sin_squared = 1.0 - cos_horizon * cos_horizon;
    float sine_term = acos(cos_horizon) - cos_horizon * sqrt(sin_squared);
    return 0.5 * (s.cos_normal * sin_squared + side * s.sin_normal * sine_term);
}

// The integral of a whole side, down to the tangent plane.
float side_integral(Slice s, float side) {
    return 0.5 * (s.full_integral + side * 0.5 * PI * s.sin_normal);
}

// The mean direction between two horizon angles, h1 < 0 < h2, with its integral as the length.
vec3 bent_direction(Slice s, float h1, float h2) {
    float n = s.normal_angle;
    float t = 6.0 * (sin(h1 - n) + sin(h2 - n)) - sin(3.0 * h1 - n) - sin(3.0 * h2 - n) + 16.0 * sin(n)
            - 3.0 * (sin(h1 + n) + sin(h2 + n));
    float e = 8.0 * cos(n) - cos(3.0 * h1 - n) - cos(3.0 * h2 - n) - 3.0 * (cos(h1 + n) + cos(h2 + n));
    return (s.tangent * t + s.view_dir * e) / 12.0;
}
