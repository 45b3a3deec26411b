// Phong 1975: kd NoL + ks RoV^n, without 1/π. There is no highlight where the surface faces away from the light.
#pragma needs(phong)

#ifdef SAMPLES_DIRECTIONS
#include <sampled_directions.glsl>
#define HAS_SAMPLED_DIRECTIONS

vec3 sample_direction(Surface s, vec3 xi) {
    if (xi.z >= lobe_share(s.f0, s.diffuse)) return tangent_frame_of(s.normal) * sample_cosine(xi.xy);
    return tangent_frame_of(reflect(-s.view_dir, s.normal)) * sample_cosine_power(xi.xy, s.exponent);
}

float direction_density(Surface s, vec3 light_dir) {
    float share = lobe_share(s.f0, s.diffuse), RoL = dot(reflect(-s.view_dir, s.normal), light_dir);
    float lobe = (s.exponent + 1.0) / (2.0 * PI) * pow(max(RoL, 1e-6), s.exponent);
    return share * lobe + (1.0 - share) * max(dot(s.normal, light_dir), 0.0) / PI;
}
#endif

ReflectedLight shade(Surface s, vec3 light_dir) {
    float NoL = dot(s.normal, light_dir);
    vec3 reflection_dir = 2.0 * NoL * s.normal - light_dir;
    float highlight = pow(max(dot(reflection_dir, s.view_dir), 1e-6), s.exponent);
    return ReflectedLight(s.diffuse * max(NoL, 0.0), NoL > 0.0 ? s.f0 * highlight : vec3(0.0));
}
