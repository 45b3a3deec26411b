// A slice of a pixel's hemisphere through the eye and an arm and its opposite (J. Jimenez et al., "Practical Real-Time
// Strategies for Accurate Indirect Occlusion", 2016). Angles in it count from the direction to the eye, towards the
// arm.
struct Slice {
    vec3 eye;      // unit, from the pixel towards the eye
    vec3 tangent;  // unit, across it, towards the arm
    float lean;    // of the normal, as far as it lies in the slice
    float share;   // how much of the normal that is: the slice's part of the light
};

Slice slice_along(vec2 along, vec3 eye, vec3 normal) {
    vec3 across = normalize(cross(vec3(along, 0.0), eye));
    vec3 tangent = cross(eye, across);
    vec3 projected = normal - across * dot(normal, across);
    return Slice(eye, tangent, atan(dot(projected, tangent), dot(projected, eye)), length(projected));
}

// Light of a white sky from between the eye and an angle, weighted by the cosine and the slices' spreading.
float arc(Slice s, float angle) {
    return 0.25 * (cos(s.lean) - cos(2.0 * angle - s.lean) + 2.0 * angle * sin(s.lean));
}

// The same of the whole slice, down to the tangent plane on both sides.
float whole_arc(Slice s) {
    return cos(s.lean) + s.lean * sin(s.lean);
}

// Its direction between two angles, before < 0 < after, as long as there is light.
vec3 arc_direction(Slice s, float before, float after) {
    float n = s.lean;
    float t = 6.0 * (sin(before - n) + sin(after - n)) - sin(3.0 * before - n) - sin(3.0 * after - n) + 16.0 * sin(n)
            - 3.0 * (sin(before + n) + sin(after + n));
    float e = 8.0 * cos(n) - cos(3.0 * before - n) - cos(3.0 * after - n) - 3.0 * (cos(before + n) + cos(after + n));
    return (s.tangent * t + s.eye * e) / 12.0;
}
