// Colour temperature: blackbodies, and adaptation from one to another.

// Chromaticity of a blackbody of 1667 to 25000 K: CIE 1931 x and y (a fit by Kim et al. 2002). `kelvin` is its
// temperature.
vec2 blackbody_chromaticity(float kelvin) {
    float m = 1e3 / kelvin;
    float x = kelvin < 4000.0 ? ((-0.2661239 * m - 0.2343589) * m + 0.8776956) * m + 0.179910
                              : ((-3.0258469 * m + 2.1070379) * m + 0.2226347) * m + 0.240390;
    float y = kelvin < 2222.0   ? ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683
              : kelvin < 4000.0 ? ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867
                                : ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483;
    return vec2(x, y);
}

// Responses of the cones of Bradford (Lam 1985) to a blackbody of luminance 1 and temperature `kelvin`.
vec3 blackbody_cones(float kelvin) {
    const mat3 xyz_to_cones = mat3(0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296);
    vec2 xy = blackbody_chromaticity(kelvin);
    return xyz_to_cones * vec3(xy.x / xy.y, 1.0, (1.0 - xy.x - xy.y) / xy.y);
}

// The linear Rec. 709 `color`, adapted from a blackbody of `kelvin` to one of 6500 K (von Kries adaptation).
vec3 adapted_to_daylight(vec3 color, float kelvin) {
    const mat3 rec709_to_cones =
        mat3(0.4226580, 0.0556908, 0.0213792, 0.4913566, 0.9615562, 0.0876439, 0.0273645, 0.0231894, 0.9807434);
    return inverse(rec709_to_cones) * (blackbody_cones(6500.0) / blackbody_cones(kelvin) * (rec709_to_cones * color));
}
