// Occlusion and radiative transfer between discs (M. Bunnell, "Dynamic Ambient Occlusion and Indirect Lighting", GPU
// Gems 2, 2005). `separation` is the distance of their centres in metres, `area` the emitter's area in square metres.
#include <math.glsl>

// Fraction, 0 to 1, of the receiver's hemisphere that the emitter occludes. `cos_emitter` and `cos_receiver` are the
// cosines between the normals and the line between the centres, `separation` and `area` as above.
float disc_occlusion(float separation, float area, float cos_emitter, float cos_receiver) {
    float fraction = 1.0 - separation * inversesqrt(area / PI + separation * separation);
    return fraction * max(cos_emitter, 0.0) * clamp(4.0 * cos_receiver, 0.0, 1.0);
}

// Form factor, from the same `separation`, `area`, `cos_emitter` and `cos_receiver`: the irradiance / π that the
// receiver gets per unit of the emitter's radiance. It tends to 1 for an infinitely large emitter.
float disc_form_factor(float separation, float area, float cos_emitter, float cos_receiver) {
    return area * max(cos_emitter, 0.0) * max(cos_receiver, 0.0) / (PI * separation * separation + area);
}
