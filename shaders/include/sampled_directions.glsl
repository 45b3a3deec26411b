// Random directions and their densities in 1/sr, for shading models that sample directions of reflected light.
#include <brdf.glsl>
#include <luminance.glsl>

// Unit tangent, bitangent and `normal` as columns.
mat3 tangent_frame_of(vec3 normal) {
    vec3 tangent = any_tangent(normal);
    return mat3(tangent, cross(normal, tangent), normal);
}

// Direction about z with density cos θ / π, from a point `xi` of the unit square.
vec3 sample_cosine(vec2 xi) {
    float r = sqrt(xi.x), phi = 2.0 * PI * xi.y;
    return vec3(r * cos(phi), r * sin(phi), sqrt(max(1.0 - xi.x, 0.0)));
}

// Direction about z with density (n + 1) / (2 π) cosⁿ θ, from a point `xi` of the unit square.
vec3 sample_cosine_power(vec2 xi, float n) {
    float cos_theta = pow(max(xi.x, 1e-12), 1.0 / (n + 1.0)), phi = 2.0 * PI * xi.y;
    float sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
    return vec3(sin_theta * cos(phi), sin_theta * sin(phi), cos_theta);
}

// The unit vector to the viewer in tangent space, above the horizon. Interpolated and mapped normals may turn away from
// the viewer; directions are then chosen as for a viewer at grazing incidence, and have the density of this choice.
vec3 viewer_above(vec3 v) {
    return normalize(vec3(v.xy, max(v.z, 1e-4)));
}

// GGX microfacet normal from those visible along `v`, in tangent space, from a point `xi` of the unit square (E. Heitz,
// "Sampling the GGX Distribution of Visible Normals", 2018). alpha: along x and y.
vec3 sample_visible_normal(vec3 v, vec2 alpha, vec2 xi) {
    vec3 stretched = normalize(vec3(alpha * v.xy, v.z));
    float across = dot(stretched.xy, stretched.xy);
    vec3 t = across > 1e-20 ? vec3(-stretched.y, stretched.x, 0.0) * inversesqrt(across) : vec3(1.0, 0.0, 0.0);
    vec3 b = cross(stretched, t);
    float r = sqrt(xi.x), phi = 2.0 * PI * xi.y, s = 0.5 + 0.5 * stretched.z;
    float x = r * cos(phi), y = mix(sqrt(max(1.0 - x * x, 0.0)), r * sin(phi), s);
    vec3 n = x * t + y * b + sqrt(max(1.0 - x * x - y * y, 0.0)) * stretched;
    return normalize(vec3(alpha * n.xy, max(n.z, 1e-7)));
}

// Density of the direction that is reflected at such a normal, over the distribution D of all normals; `v` as above.
float visible_normal_density(vec3 v, vec2 alpha) {
    return 0.5 / (v.z + sqrt(v.z * v.z + dot(alpha * v.xy, alpha * v.xy)));
}

// The probability of choosing `lobe` and not the `other` one, by their energy. Neither is left out.
float lobe_share(vec3 lobe, vec3 other) {
    float a = luminance_of(lobe), b = luminance_of(other);
    return b <= 0.0 ? 1.0 : a <= 0.0 ? 0.0 : clamp(a / (a + b), 0.1, 0.9);
}
