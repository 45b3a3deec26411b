// What four pixels that are drawn together look up for one another. Derivatives are differences within the four, and so
// lead from each to the others. Needs `surfaces.glsl` and `value.glsl`.
struct Seen {
    vec3 position;
    vec3 normal;  // 0 where nothing is
    Value value;
};

// What the neighbour along an axis has; `other` leads to it, 1 or -1.
Seen from_x(Seen s, float other) {
    return Seen(s.position + other * dFdxFine(s.position), s.normal + other * dFdxFine(s.normal),
                s.value + other * dFdxFine(s.value));
}

Seen from_y(Seen s, float other) {
    return Seen(s.position + other * dFdyFine(s.position), s.normal + other * dFdyFine(s.normal),
                s.value + other * dFdyFine(s.value));
}
