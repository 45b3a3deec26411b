// Luminance.

// Relative luminance of a linear colour `c` with Rec. 709 primaries (ITU-R BT.709).
float luminance_of(vec3 c) {
    return dot(c, vec3(0.2126, 0.7152, 0.0722));
}
