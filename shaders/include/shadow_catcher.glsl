// Shadow catchers: surfaces that show what is behind them, darkened by the shadows and the occlusion on them. A catcher
// is a diffuse surface whose reflectance is chosen so that, without shadows, it reflects exactly what is behind it: all
// techniques for shadows, occlusion and indirect light apply to it (P. Debevec, "Rendering Synthetic Objects into Real
// Scenes", 1998).
#include <environment.glsl>
#include <lights.glsl>
#include <surface.glsl>

const float CATCHER_F0 = 0.04, CATCHER_F90 = 0.4;  // reflectance straight on and at grazing angles

// How much a catcher shows the environment like the background: 0 near the point of projection, 1 from its distance on,
// and 1 without a projection.
float catcher_fade(vec3 position) {
    float reach = environment_projection.w;
    return reach > 0.0 ? smoothstep(0.3, 1.0, length(position.xz - environment_projection.xz) / reach) : 1.0;
}

// Direction of the environment that a catcher shows to a ray of this unit direction.
vec3 caught_direction(vec3 position, vec3 ray) {
    vec3 projected = position - environment_projection.xyz;
    return normalize(mix(normalize(projected), ray, catcher_fade(position)));
}

// Fraction of the light that a catcher reflects like a polished floor: slightly, more at grazing angles.
float catcher_reflectance(Surface s) {
    float grazing = 1.0 - clamp(dot(s.normal, s.view_dir), 0.0, 1.0), square = grazing * grazing;
    return mix(CATCHER_F0, CATCHER_F90, square * square * grazing) * (1.0 - catcher_fade(s.position));
}

// Light that a catcher receives without shadows, as radiance of a white surface. `from_all_sides` is the irradiance / π
// of the environment or the constant ambient light.
vec3 unshadowed_light(Surface s, vec3 from_all_sides) {
    vec3 sum = from_all_sides;
#ifdef NEEDS_PHONG  // empirical models reflect kd of the irradiance of lights, without 1/π
    const float scale = 1.0;
#else
    const float scale = 1.0 / PI;
#endif
#if LIGHT_COUNT > 0 && !defined(NO_LIGHTS)
    for (int i = 0; i < LIGHT_COUNT; ++i) {
        vec3 light_dir;
        vec3 irradiance = irradiance_from(lights[i], s.position, light_dir);
        sum += irradiance * (max(dot(s.normal, light_dir), 0.0) * scale);
    }
#endif
    return sum;
}

// Gives a catcher the reflectance with which it reflects `shown` of the `unshadowed` light. Shadows fade out together
// with the projection, if there is one.
void catch_shadows(inout Surface s, vec3 shown, vec3 unshadowed) {
    float fade = environment_projection.w > 0.0 ? catcher_fade(s.position) : 0.0;
    s.base_color = shown;
    s.diffuse = shown * (1.0 - fade) / max(unshadowed, 1e-6);
    s.ambient = s.diffuse;
    s.emissive = shown * fade;
    s.f0 = vec3(0.0);
    s.f90 = 0.0;
}
