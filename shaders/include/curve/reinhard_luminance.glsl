// Reinhard et al. 2002: x/(1+x), applied to luminance.
#include <luminance.glsl>

vec3 tone_curve(vec3 c) {
    return c / (1.0 + luminance_of(c));
}
