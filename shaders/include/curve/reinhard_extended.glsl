// Reinhard et al. 2002: the extended operator, applied to luminance. `white` is the smallest luminance that becomes
// white.
#include <luminance.glsl>

vec3 tone_curve(vec3 c) {
    float l = luminance_of(c);
    return c * ((1.0 + l / (white * white)) / (1.0 + l));
}
