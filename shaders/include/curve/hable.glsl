// J. Hable, "Filmic Tonemapping Operators", 2010: a film's toe and shoulder, per channel, with his exposure of one stop
// and his linear white of 11.2.
vec3 hable_film(vec3 c) {
    const float shoulder = 0.15, linear = 0.50, angle = 0.10, toe = 0.20, toe_up = 0.02, toe_down = 0.30;
    vec3 up = c * (shoulder * c + angle * linear) + toe * toe_up;
    vec3 down = c * (shoulder * c + linear) + toe * toe_down;
    return up / down - toe_up / toe_down;
}

vec3 tone_curve(vec3 c) {
    return hable_film(2.0 * c) / hable_film(vec3(11.2));
}
