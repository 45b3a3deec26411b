// How much of an even light a surface mirrors, as f0 x + f90 y, over the root of N.V and perceptual roughness (Karis
// 2013): the integral of the shading model's own specular term. Half vectors are drawn as the viewer sees them (Heitz
// 2018), which leaves hardly anything to average.
#include <brdf.glsl>
#include <hammersley.glsl>

in vec2 v_uv;  // root of N.V, roughness
out vec2 brdf_table;

// A half vector about +Z with the density of those that are visible from `viewer`.
vec3 visible_half_vector(vec3 viewer, vec2 point, float alpha) {
    vec3 stretched = normalize(vec3(alpha * viewer.xy, viewer.z));
    vec3 across = vec3(0.0, 1.0, 0.0);  // the viewer stands in the plane of x and z
    vec3 other = cross(stretched, across);
    float radius = sqrt(point.x), angle = 2.0 * PI * point.y;
    float x = radius * cos(angle), tilt = 0.5 * (1.0 + stretched.z);
    float y = mix(sqrt(max(1.0 - x * x, 0.0)), radius * sin(angle), tilt);
    vec3 h = x * across + y * other + sqrt(max(1.0 - x * x - y * y, 0.0)) * stretched;
    return normalize(vec3(alpha * h.xy, max(h.z, 0.0)));
}

void main() {
    float NoV = v_uv.x * v_uv.x, alpha = max(v_uv.y * v_uv.y, 0.001);
    vec3 viewer = vec3(sqrt(1.0 - NoV * NoV), 0.0, NoV);
    float unmasked = 2.0 * NoV / (NoV + sqrt(NoV * NoV * (1.0 - alpha * alpha) + alpha * alpha));
    vec2 sum = vec2(0.0);
    for (int i = 0; i < TABLE_SAMPLES; ++i) {
        vec3 h = visible_half_vector(viewer, hammersley(i, TABLE_SAMPLES), alpha);
        float VoH = max(dot(viewer, h), 0.0);
        float NoL = 2.0 * VoH * h.z - NoV;
        if (NoL <= 0.0) continue;
#if SMITH == SMITH_FAST
        float visible = visibility_smith_fast(NoL, NoV, alpha);
#else
        float visible = visibility_smith(NoL, NoV, alpha);
#endif
        float grazing = pow(1.0 - VoH, 5.0);
        sum += 4.0 * visible * NoL * NoV / unmasked * vec2(1.0 - grazing, grazing);
    }
    brdf_table = sum / float(TABLE_SAMPLES);
}
