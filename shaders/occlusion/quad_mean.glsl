// The mean over the four pixels of a 2×2 quad, among those on the same surface. Fine derivatives are differences
// between neighbours in the quad, so adding one to a pixel's value gives the neighbour's.

void average_pair(inout vec4 value, vec4 difference, vec4 surface, vec4 other_surface, vec3 offset, float tolerance) {
    if (other_surface.w == 0.0) return;
    float weight = bilateral_weight(offset, surface.xyz, other_surface.xyz, tolerance);
    value += difference * weight / (1.0 + weight);
}

// Averages the pixel's `value` over its quad.
//
// Args: the pixel's value, its texel of `surfaces`, its view-space position, and the tolerance of planes in metres.
vec4 quad_mean(vec4 value, vec4 surface, vec3 position, float tolerance) {
    vec2 side = vec2(1 - 2 * (ivec2(gl_FragCoord.xy) & 1));  // towards the neighbour, 1 or -1
    average_pair(value, side.x * dFdxFine(value), surface, surface + side.x * dFdxFine(surface),
                 side.x * dFdxFine(position), tolerance);
    average_pair(value, side.y * dFdyFine(value), surface, surface + side.y * dFdyFine(surface),
                 side.y * dFdyFine(position), tolerance);
    return value;
}
