// Noise computed from the pixel position.

// Interleaved gradient noise, 0 to 1, of a `texel`'s position: evenly distributed over small neighbourhoods, without a
// visible period (J. Jimenez, "Next Generation Post Processing in Call of Duty: Advanced Warfare", 2014).
float interleaved_gradient_noise(vec2 texel) {
    return fract(52.9829189 * fract(dot(texel, vec2(0.06711056, 0.00583715))));
}
