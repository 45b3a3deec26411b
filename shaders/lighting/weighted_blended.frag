// A lit transparent surface for weighted blended order-independent transparency.
// Weights: M. McGuire and L. Bavoil, "Weighted Blended Order-Independent Transparency", 2013, equations 7 to 10.
#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>

uniform float unit;     // metres
out vec4 accumulation;  // weighted premultiplied colour and weighted opacity
out float revealage;    // opacity, which blending multiplies into the visibility of the background

float weight_of(float z) {
#if WEIGHT == WEIGHT_DISTANCE_SQUARED
    return clamp(10.0 / (1e-5 + pow(z / 5.0, 2.0) + pow(z / 200.0, 6.0)), 1e-2, 3e3);
#elif WEIGHT == WEIGHT_DISTANCE_CUBED
    return clamp(10.0 / (1e-5 + pow(z / 10.0, 3.0) + pow(z / 200.0, 6.0)), 1e-2, 3e3);
#elif WEIGHT == WEIGHT_DISTANCE_FOURTH
    return clamp(0.03 / (1e-5 + pow(z / 200.0, 4.0)), 1e-2, 3e3);
#elif WEIGHT == WEIGHT_WINDOW_DEPTH
    return max(1e-2, 3e3 * pow(gl_FragCoord.z, 3.0));  // depth is reversed: this is the paper's 1 - d
#else
    return 1.0;
#endif
}

void main() {
    View view = PASS_VIEW;
    Surface s = fragment_surface(view);
    vec3 color = through_air(s.position, radiance_of(s, direct_lighting(s), environment_lighting(s)));
    float z = max(linear_depth(view, gl_FragCoord.z), 0.0) / unit;
    accumulation = vec4(color, 1.0) * s.alpha * weight_of(z);
    revealage = s.alpha;
}
