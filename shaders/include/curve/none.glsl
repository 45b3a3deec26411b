// No tone curve: values above 1 are clipped.
vec3 tone_curve(vec3 c) {
    return c;
}
