// J. Hable, "Filmic Tonemapping Operators", 2010: toe and shoulder of film, per channel, with his exposure of one stop
// and linear white of 11.2.
vec3 hable_film(vec3 c) {
    const float shoulder = 0.15, linear = 0.50, angle = 0.10, toe = 0.20, toe_numerator = 0.02, toe_denominator = 0.30;
    vec3 numerator = c * (shoulder * c + angle * linear) + toe * toe_numerator;
    vec3 denominator = c * (shoulder * c + linear) + toe * toe_denominator;
    return numerator / denominator - toe_numerator / toe_denominator;
}

vec3 tone_curve(vec3 c) {
    return hable_film(2.0 * c) / hable_film(vec3(11.2));
}
