// The BRDF factor of the split-sum approximation (Karis 2013): the integral of the shading model's specular term over
// the hemisphere, as f0 * x + f90 * y, over sqrt(NoV) and perceptual roughness. Visible half vectors are sampled (Heitz
// 2018), which leaves little variance.
#include <brdf.glsl>
#include <hammersley.glsl>
#ifdef SHEEN_TABLE
#include <sheen.glsl>
#endif

in vec2 v_uv;  // sqrt(NoV), roughness
#ifdef SHEEN_TABLE
out vec4 brdf_table;  // z: a quarter of the fraction of uniform light that white sheen reflects, which may exceed 1
#else
out vec2 brdf_table;
#endif

// Half vector in tangent space, from the distribution of those that are visible from `view_dir`.
vec3 visible_half_vector(vec3 view_dir, vec2 xi, float alpha) {
    vec3 stretched = normalize(vec3(alpha * view_dir.xy, view_dir.z));
    vec3 tangent = vec3(0.0, 1.0, 0.0);  // perpendicular to the view direction, which lies in the xz plane
    vec3 bitangent = cross(stretched, tangent);
    float radius = sqrt(xi.x), angle = 2.0 * PI * xi.y;
    float x = radius * cos(angle), s = 0.5 * (1.0 + stretched.z);
    float y = mix(sqrt(max(1.0 - x * x, 0.0)), radius * sin(angle), s);
    vec3 h = x * tangent + y * bitangent + sqrt(max(1.0 - x * x - y * y, 0.0)) * stretched;
    return normalize(vec3(alpha * h.xy, max(h.z, 0.0)));
}

#ifdef SHEEN_TABLE
// Fraction of uniform light that white sheen reflects, from light directions whose cosine is the square of a uniform
// number: most are grazing, as most of the lobe is.
float sheen_albedo(vec3 view_dir, float roughness) {
    float sum = 0.0;
    for (int i = 0; i < 4 * TABLE_SAMPLES; ++i) {
        vec2 xi = hammersley(i, 4 * TABLE_SAMPLES);
        xi.x = max(xi.x, 0.5 / float(4 * TABLE_SAMPLES));
        float NoL = xi.x * xi.x, angle = PI * xi.y, sine = sqrt(1.0 - NoL * NoL);
        vec3 light_dir = vec3(sine * cos(angle), sine * sin(angle), NoL);
        float NoH = normalize(view_dir + light_dir).z;
        sum += charlie_brdf(NoL, view_dir.z, NoH, roughness) * NoL * 2.0 * xi.x;
    }
    return 2.0 * PI * sum / float(4 * TABLE_SAMPLES);
}
#endif

void main() {
    float NoV = v_uv.x * v_uv.x, alpha = max(v_uv.y * v_uv.y, 0.001);
    vec3 view_dir = vec3(sqrt(1.0 - NoV * NoV), 0.0, NoV);
    float masking = 2.0 * NoV / (NoV + sqrt(NoV * NoV * (1.0 - alpha * alpha) + alpha * alpha));
    vec2 sum = vec2(0.0);
    for (int i = 0; i < TABLE_SAMPLES; ++i) {
        vec3 h = visible_half_vector(view_dir, hammersley(i, TABLE_SAMPLES), alpha);
        float VoH = max(dot(view_dir, h), 0.0);
        float NoL = 2.0 * VoH * h.z - NoV;
        if (NoL <= 0.0) continue;
#if SMITH == SMITH_FAST
        float visibility_term = visibility_smith_fast(NoL, NoV, alpha);
#else
        float visibility_term = visibility_smith(NoL, NoV, alpha);
#endif
        float fresnel = pow(1.0 - VoH, 5.0);
        sum += 4.0 * visibility_term * NoL * NoV / masking * vec2(1.0 - fresnel, fresnel);
    }
#ifdef SHEEN_TABLE
    float white = sheen_albedo(view_dir, max(v_uv.y, LEAST_SHEEN_ROUGHNESS));
    brdf_table = vec4(sum / float(TABLE_SAMPLES), min(0.25 * white, 1.0), 0.0);
#else
    brdf_table = sum / float(TABLE_SAMPLES);
#endif
}
