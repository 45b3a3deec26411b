// What a sample stands for in its arm's slice: the strip of its surface half-way to those before and after it, and
// what is taken to lie behind (O. Therrien, Y. Levesque and G. Gilet, "Screen Space Indirect Lighting with Visibility
// Bitmask", 2023).

// The lines of sight along an arm: each starts at `start` and leads along `way`, both of which change evenly with the
// share of the arm's reach that it is away from the pixel.
struct Sights {
    vec3 start;
    vec3 start_change;
    vec3 way;
    vec3 way_change;
};

Sights sights_along(View v, vec2 middle, vec2 reach) {
    vec3 here = view_position(v, middle, 1.0);
    vec3 change = view_position(v, middle + reach, 1.0) - here;
    if (v.projection[2][3] == 0.0) return Sights(here, change, vec3(0.0, 0.0, -1.0), vec3(0.0));
    return Sights(vec3(0.0), vec3(0.0), here, change);
}

// Where a surface, extended, is seen at another share of the reach: an offset from the pixel, for one of its own. No
// farther along it than the pixel is away.
vec3 extended(Sights s, float share, vec3 position, vec3 offset, vec3 normal) {
    vec3 start = s.start + share * s.start_change - position;
    vec3 way = s.way + share * s.way_change;
    float slope = dot(normal, way);
    vec3 there = start + way * (dot(normal, offset - start) / slope);
    vec3 along = there - offset;
    return abs(slope) > 1e-4 && dot(along, along) < dot(offset, offset) ? there : offset;
}

// The cosine of an offset to the eye.
float rise_of(vec3 offset, vec3 eye) {
    return dot(offset, eye) * inversesqrt(max(dot(offset, offset), 1e-20));
}

// The cosines to the eye between which the strip lies, seen from a pixel: of its rear and of its front.
//
// Args: the shares of the reach that it goes from and to, the pixel's position, the sample's offset from it and its
// normal, and how thick it is in metres.
vec2 strip_of(Sights s, float from, float to, vec3 position, vec3 offset, vec3 normal, vec3 eye, float thickness) {
    vec3 at = position + offset;
    vec3 sight = s.way_change == vec3(0.0) ? s.way : at * inversesqrt(dot(at, at));
    float middle = rise_of(offset, eye);
    float before = rise_of(extended(s, from, position, offset, normal), eye);
    float after = rise_of(extended(s, to, position, offset, normal), eye);
    float behind = rise_of(offset + sight * thickness, eye);
    return clamp(vec2(min(min(middle, before), behind), max(middle, after)), -1.0, 1.0);
}
