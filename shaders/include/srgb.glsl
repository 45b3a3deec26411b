// The transfer function of display values.

// The sRGB transfer function (IEC 61966-2-1): the encoded value of a linear colour `c`, both from 0 to 1.
vec3 linear_to_srgb(vec3 c) {
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

// Its inverse: the linear value of an encoded colour `c`.
vec3 srgb_to_linear(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

// The light of a display colour `c`; both are premultiplied by alpha.
vec4 display_to_light(vec4 c) {
    return c.a > 0.0 ? vec4(srgb_to_linear(c.rgb / c.a) * c.a, c.a) : vec4(0.0);
}

// The display colour of light `c`; both are premultiplied by alpha.
vec4 light_to_display(vec4 c) {
    return c.a > 0.0 ? vec4(linear_to_srgb(c.rgb / c.a) * c.a, c.a) : vec4(0.0);
}
