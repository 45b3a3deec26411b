// The mean over four pixels that are computed together, where they lie on the same surface. Derivatives are differences
// within the four, and so lead from each to the others.

void mean_of_pair(inout vec4 value, vec4 change, vec4 here, vec4 there, vec3 offset, float tolerance) {
    if (there.w == 0.0) return;
    float weight = same_surface(offset, here.xyz, there.xyz, tolerance);
    value += change * weight / (1.0 + weight);
}

// Args: the pixel's own value, its texel of `surfaces`, its position, and how far off a plane is on it, in metres.
vec4 mean_of_quad(vec4 value, vec4 here, vec3 position, float tolerance) {
    vec2 other = vec2(1 - 2 * (ivec2(gl_FragCoord.xy) & 1));
    mean_of_pair(value, other.x * dFdxFine(value), here, here + other.x * dFdxFine(here),
                 other.x * dFdxFine(position), tolerance);
    mean_of_pair(value, other.y * dFdyFine(value), here, here + other.y * dFdyFine(here),
                 other.y * dFdyFine(position), tolerance);
    return value;
}
