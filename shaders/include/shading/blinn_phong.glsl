// Blinn 1977: kd NoL + ks NoH^(4n), without 1/π. The exponent is four times Phong's, for a highlight of about equal
// size.
#pragma needs(phong)

#ifdef SAMPLES_DIRECTIONS
#include <sampled_directions.glsl>
#define HAS_SAMPLED_DIRECTIONS

vec3 sample_direction(Surface s, vec3 xi) {
    mat3 frame = tangent_frame_of(s.normal);
    if (xi.z >= lobe_share(s.f0, s.diffuse)) return frame * sample_cosine(xi.xy);
    return reflect(-s.view_dir, frame * sample_cosine_power(xi.xy, 4.0 * s.exponent));
}

float direction_density(Surface s, vec3 light_dir) {
    float share = lobe_share(s.f0, s.diffuse);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    float n = 4.0 * s.exponent, NoH = max(abs(dot(s.normal, half_vector)), 1e-6);
    float lobe = (n + 1.0) / (2.0 * PI) * pow(NoH, n) / max(4.0 * abs(dot(s.view_dir, half_vector)), 1e-6);
    return share * lobe + (1.0 - share) * max(dot(s.normal, light_dir), 0.0) / PI;
}
#endif

ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = dot(s.normal, light_dir);
    vec3 half_vector = normalize(light_dir + s.view_dir);
    float highlight = pow(max(dot(s.normal, half_vector), 1e-6), 4.0 * s.exponent);
    return ReflectedLight(s.diffuse * max(NoL, 0.0), NoL > 0.0 ? s.f0 * highlight : vec3(0.0));
}
