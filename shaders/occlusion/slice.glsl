// A slice of a pixel's hemisphere through the eye and an arm and its opposite (J. Jimenez et al., "Practical Real-Time
// Strategies for Accurate Indirect Occlusion", 2016). Angles in it count from the direction to the eye, towards the
// arm. What is seen there is given by its cosine to the eye and its side, 1 towards the arm and -1 away from it: all
// but one term of the paper's integrals follows from those without a trigonometric function.
struct Slice {
    vec3 eye;      // unit, from the pixel towards the eye
    vec3 tangent;  // unit, across it, towards the arm
    float lean;    // of the normal, as far as it lies in the slice
    float cosine;  // of the lean
    float sine;
    float share;   // how much of the normal that is: the slice's part of the light
    float whole;   // light of a white sky from all of the slice, down to the tangent plane on both sides
};

Slice slice_along(vec2 along, vec3 eye, vec3 normal) {
    vec3 tangent = cross(eye, normalize(cross(vec3(along, 0.0), eye)));
    vec2 upright = vec2(dot(normal, eye), dot(normal, tangent));
    float share = max(length(upright), 1e-6);
    float lean = atan(upright.y, upright.x);
    vec2 turn = upright / share;
    return Slice(eye, tangent, lean, turn.x, turn.y, share, turn.x + lean * turn.y);
}

// The cosine to the eye of the tangent plane on a side.
float tangent_plane(Slice s, float side) {
    return -side * s.sine;
}

// Light of a white sky from between the eye and a cosine to it, weighted by the cosine and the slices' spreading.
float arc(Slice s, float rise, float side) {
    float across = 1.0 - rise * rise;
    return 0.5 * (s.cosine * across + side * s.sine * (acos(rise) - rise * sqrt(across)));
}

// The same of a whole side, down to the tangent plane.
float whole_side(Slice s, float side) {
    return 0.5 * (s.whole + side * 0.5 * PI * s.sine);
}

// Its direction between two angles, before < 0 < after, as long as there is light.
vec3 arc_direction(Slice s, float before, float after) {
    float n = s.lean;
    float t = 6.0 * (sin(before - n) + sin(after - n)) - sin(3.0 * before - n) - sin(3.0 * after - n) + 16.0 * sin(n)
            - 3.0 * (sin(before + n) + sin(after + n));
    float e = 8.0 * cos(n) - cos(3.0 * before - n) - cos(3.0 * after - n) - 3.0 * (cos(before + n) + cos(after + n));
    return (s.tangent * t + s.eye * e) / 12.0;
}
