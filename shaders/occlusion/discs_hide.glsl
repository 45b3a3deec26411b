// What discs hide of the sky, the other of `ssao_disc`'s two forms (M. Bunnell, "Dynamic Ambient Occlusion and Indirect
// Lighting", GPU Gems 2, 2005).
#include <disc_form_factor.glsl>

// A large disc hides less than its parts would. All are as large as if there were this many of them, so that how dark
// it is does not depend on how many samples are taken.
const float DISCS = 2048.0;

// More than this no arm hides, though discs that stand close add up to more.
const float MOST = 2.0;

// What a disc at `offset` hides; nothing from beyond the radius or below the horizon.
float hiding(View v, vec3 offset, vec3 normal, float far_off, float area, float facing) {
    float apart = length(offset);
    if (apart > radius || !rises(v, offset, normal, far_off)) return 0.0;
    return disc_occlusion(apart, area, facing, dot(normal, offset) / apart);
}

// What a sample hides of an arm's sky.
//
// Args: whether nothing nearer along the arm hides it, its offset from the pixel and the pixel's normal, the larger of
// both distances, its normal and line of sight, its share of the picture's disc in square metres.
float hidden_by(View v, bool in_sight, vec3 offset, vec3 normal, float far_off, vec3 faces, vec3 sight, float ring) {
    float facing = -dot(faces, offset) / length(offset);
    float slant = max(abs(dot(faces, sight)), 0.05);
    float hides = in_sight ? hiding(v, offset, normal, far_off, ring / DISCS / slant, abs(facing)) : 0.0;
    if (facing < 0.0) {
        // The far side of something solid. Its near side is not seen: a disc that faces the receiver stands for it,
        // behind what is seen, where the line of sight comes nearest.
        vec3 way = normalize(sight);
        vec3 nearest = offset + way * clamp(-dot(offset, way), 0.0, radius);
        hides = max(hides, hiding(v, nearest, normal, far_off, ring / DISCS, 1.0));
    }
    return hides * DISCS / float(STEPS);
}
