// Light that passes through a surface (KHR_materials_transmission, volume and dispersion), in screen space: a copy of
// the picture of opaque surfaces, `behind`, is read where the refracted ray leaves the volume. Its mip levels blur it
// as a rough surface does. It contains neither other transmissive surfaces nor anything outside the picture.
#include <environment_lighting.glsl>
#include <math.glsl>
#include <pass_view.glsl>

uniform sampler2D behind;

// Radiance and coverage of the picture at coordinates `uv`, blurred to a `level`. Cubic B-splines of four samples
// hide texels of coarse levels (C. Sigg and M. Hadwiger, "Fast Third-Order Texture Filtering", 2005).
vec4 blurred_picture(vec2 uv, float level) {
    vec4 sharp = textureLod(behind, uv, 0.0);
    if (level <= 0.0) return sharp;
    float lower = floor(level);
    vec4 sums[2];
    for (int k = 0; k < 2; ++k) {
        vec2 size = vec2(textureSize(behind, min(int(lower) + k, textureQueryLevels(behind) - 1)));
        vec2 at = uv * size - 0.5, texel = floor(at), f = at - texel;
        vec2 w0 = (1.0 - f) * (1.0 - f) * (1.0 - f) / 6.0, w1 = 2.0 / 3.0 - 0.5 * f * f * (2.0 - f);
        vec2 w3 = f * f * f / 6.0, w2 = 1.0 - w0 - w1 - w3;
        vec2 g0 = w0 + w1, g1 = w2 + w3;
        vec2 h0 = (texel - 0.5 + w1 / g0) / size, h1 = (texel + 1.5 + w3 / g1) / size;
        float l = lower + float(k);
        sums[k] = g0.y * (g0.x * textureLod(behind, h0, l) + g1.x * textureLod(behind, vec2(h1.x, h0.y), l))
            + g1.y * (g0.x * textureLod(behind, vec2(h0.x, h1.y), l) + g1.x * textureLod(behind, h1, l));
    }
    if (lower < 1.0) sums[0] = sharp;  // the spline would blur the picture itself
    return mix(sums[0], sums[1], level - lower);
}

// Radiance and coverage that reach the surface from behind it with `ior` as index of refraction, before it is tinted.
vec4 refracted_light(Surface s, float ior) {
    vec3 ray = refract(-s.view_dir, s.normal, 1.0 / ior);
    vec4 clip = PASS_VIEW.view_projection * vec4(s.position + ray * s.thickness, 1.0);
    float roughness = s.roughness * clamp(2.0 * ior - 2.0, 0.0, 1.0);
    return blurred_picture(clip.xy / clip.w * 0.5 + 0.5, log2(PASS_VIEW.viewport.x) * roughness);
}

// Fraction of light that passes through the surface.
vec3 transmittance(Surface s) {
    vec3 reflected = specular_reflectance(s);
    vec3 left = exp(-s.absorption * s.thickness) * s.base_color * s.transmission * (1.0 - min(reflected, 1.0));
#ifdef SHEEN_LAYER
    left *= below_sheen(s, sheen_albedo(s, max(dot(s.normal, s.view_dir), 0.0)));
#endif
#ifdef CLEARCOAT_LAYER
    left *= 1.0 - clearcoat_reflectance(s, dot(s.clearcoat_normal, s.view_dir));
#endif
    return left;
}

// Light that passes through the surface to the viewer.
vec3 transmitted_light(Surface s) {
    vec3 light;
    if (s.dispersion > 0.0) {  // red is refracted least, and blue most
        float spread = (s.ior - 1.0) * 0.025 * s.dispersion;
        light.r = refracted_light(s, s.ior - spread).r;
        light.g = refracted_light(s, s.ior).g;
        light.b = refracted_light(s, s.ior + spread).b;
    } else {
        light = refracted_light(s, s.ior).rgb;
    }
    return light * transmittance(s);
}

// How much of the background the surface hides, together with what is seen through it.
float transmitted_coverage(Surface s) {
    vec3 left = transmittance(s);
    return 1.0 - (left.r + left.g + left.b) / 3.0 * (1.0 - refracted_light(s, s.ior).a);
}
