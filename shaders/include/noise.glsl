// Noise without memory.

// 0 to 1 at each texel, even over any few neighbours and without a period that shows: interleaved gradient noise
// (J. Jimenez, "Next Generation Post Processing in Call of Duty: Advanced Warfare", 2014).
float interleaved_gradient_noise(vec2 texel) {
    return fract(52.9829189 * fract(dot(texel, vec2(0.06711056, 0.00583715))));
}
