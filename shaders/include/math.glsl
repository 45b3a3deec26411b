// Constants and tangent frames.
const float PI = 3.14159265358979;

// A unit vector perpendicular to the unit vector `normal`.
vec3 any_tangent(vec3 normal) {
    return normalize(cross(normal, abs(normal.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0)));
}
