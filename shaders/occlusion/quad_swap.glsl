// Exchanges values between the pixels of a 2×2 quad, so that each texel is fetched once per quad. Fine derivatives are
// differences between neighbours in the quad. Needs `surfaces.glsl` and `value.glsl`.
struct SurfaceSample {
    vec3 position;
    vec3 normal;  // 0 for background
    Value value;
};

// The sample of the horizontal neighbour; `side` is 1 or -1, towards it.
SurfaceSample swap_horizontal(SurfaceSample s, float side) {
    return SurfaceSample(s.position + side * dFdxFine(s.position), s.normal + side * dFdxFine(s.normal),
                         s.value + side * dFdxFine(s.value));
}

// The sample of the vertical neighbour.
SurfaceSample swap_vertical(SurfaceSample s, float side) {
    return SurfaceSample(s.position + side * dFdyFine(s.position), s.normal + side * dFdyFine(s.normal),
                         s.value + side * dFdyFine(s.value));
}
