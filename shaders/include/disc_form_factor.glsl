// How much one disc hides of another's sky (M. Bunnell, "Dynamic Ambient Occlusion and Indirect Lighting", GPU Gems 2,
// 2005). `apart` is the distance of their centres in metres, `area` the emitter's in square metres.
#include <math.glsl>

float disc_occlusion(float apart, float area, float cos_emitter, float cos_receiver) {
    float share = 1.0 - apart * inversesqrt(area / PI + apart * apart);
    return share * max(cos_emitter, 0.0) * clamp(4.0 * cos_receiver, 0.0, 1.0);
}

// How much of one disc's radiance another receives as irradiance over pi, of which a white surface sends all on: the
// form factor, which for a disc as large as the sky is 1.
float disc_form_factor(float apart, float area, float cos_emitter, float cos_receiver) {
    return area * max(cos_emitter, 0.0) * max(cos_receiver, 0.0) / (PI * apart * apart + area);
}
