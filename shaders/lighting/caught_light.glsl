// Shadow catchers in lighting nodes: the surface that they are lit as, and what becomes of the outputs. Where the
// environment is not the background, a catcher darkens the constant background, and its alpha is how dark it is.
#ifdef HAS_SHADOW_CATCHER
#include <luminance.glsl>
#include <shadow_catcher.glsl>

#ifdef SHOWS_ENVIRONMENT
#ifdef BLURRED
uniform float backdrop_blur;
#endif
#else
uniform vec3 background;
#endif

#ifdef HAS_ENVIRONMENT
#define UNSHADOWED_LIGHT(s) unshadowed_light(s, light_from(s.normal, 2.0))
#else
#define UNSHADOWED_LIGHT(s) unshadowed_light(s, ambient)
#endif

// `unshadowed` is the light that it receives where nothing shadows it, as radiance of a white surface.
void begin_catcher(inout Surface s, vec3 unshadowed) {
    vec3 shown = vec3(1.0);
#ifdef SHOWS_ENVIRONMENT
    vec3 direction = caught_direction(s.position, -s.view_dir);
#ifdef BLURRED
    float lobe = clamp(backdrop_blur, 0.0, 1.0);
#else
    float lobe = -max(max(length(dFdx(direction)), length(dFdy(direction))), 1e-6);
#endif
    shown = light_from(direction, lobe);
#endif
    catch_shadows(s, shown, unshadowed);
}

// `coverage` is 1 in the step that begins the picture, and 0 in one that adds light to it.
void end_catcher(Surface s, float coverage) {
#ifndef SHOWS_ENVIRONMENT
    radiance = vec4(background * radiance.rgb, coverage - luminance_of(radiance.rgb));
#ifdef WRITES_DIFFUSE
    diffuse = vec4(background * diffuse.rgb, radiance.a);
#endif
#elif defined(HAS_REFLECTIONS)
    // What is reflected instead of the environment, whose reflection is in what the catcher shows.
    vec4 reflected = reflections_at_fragment();
    vec3 change = reflected.rgb - light_from(reflect(-s.view_dir, s.normal), s.roughness);
    float weight = catcher_reflectance(s) * reflected.a * coverage;
    radiance.rgb = clamp(radiance.rgb + change * weight, 0.0, MAX_HALF_FLOAT);
#endif
}
#else
#define begin_catcher(s, unshadowed)
#define end_catcher(s, coverage)
#endif
