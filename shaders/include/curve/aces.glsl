// K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2015: a rational fit, per channel.
vec3 tone_curve(vec3 c) {
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
}
