// Occlusion by discs in space (M. Bunnell, "Dynamic Ambient Occlusion and Indirect Lighting", GPU Gems 2, 2005).
#include <disc_form_factor.glsl>

// The formula is not linear in area, so discs are always as large as if there were this many of them. Occlusion then
// does not depend on the number of samples.
const float OCCLUDING_DISCS = 2048.0;

// Maximum occlusion of one direction. Discs close to one another add up to more.
const float MAX_DIRECTION_OCCLUSION = 2.0;

// Occlusion by one disc at `offset`; 0 beyond the radius and below the tangent plane.
float occlusion_of_disc(View view, vec3 offset, vec3 normal, float max_distance, float area, float cos_emitter) {
    float sample_distance = length(offset);
    if (sample_distance > radius || !is_above_tangent_plane(view, offset, normal, max_distance)) return 0.0;
    return disc_occlusion(sample_distance, area, cos_emitter, dot(normal, offset) / sample_distance);
}

// Occlusion by a sample, relative to that of one direction.
//
// Args: whether no nearer sample of the direction hides it, its offset from the pixel, the pixel's normal, the larger
// distance of both along the view axis, the sample's normal, the view ray through it, and the area in square metres
// that it stands for, across the ray.
float sample_occlusion(
    View view, bool is_visible, vec3 offset, vec3 normal, float max_distance, vec3 sample_normal, vec3 ray, float area
) {
    float cos_emitter = -dot(sample_normal, offset) / length(offset);
    float cos_ray = max(abs(dot(sample_normal, ray)), 0.05);
    float occlusion = is_visible
        ? occlusion_of_disc(view, offset, normal, max_distance, area / OCCLUDING_DISCS / cos_ray, abs(cos_emitter))
        : 0.0;
    if (cos_emitter < 0.0) {
        // The sample faces away, so it belongs to the far side of a solid object whose near side is invisible. A disc
        // that faces the pixel replaces it, where the ray behind the sample is closest to the pixel.
        vec3 direction = normalize(ray);
        vec3 closest = offset + direction * clamp(-dot(offset, direction), 0.0, radius);
        occlusion = max(
            occlusion, occlusion_of_disc(view, closest, normal, max_distance, area / OCCLUDING_DISCS, 1.0));
    }
    return occlusion * OCCLUDING_DISCS / float(STEPS);
}
