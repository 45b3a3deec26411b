// Shadow catchers in lighting nodes: the surface as which they are lit, and their outputs. Where the environment is not
// the background, a catcher darkens the constant background, and its alpha is how dark it is.
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

#ifdef MIRRORS
uniform sampler2D mirrored;
uniform sampler2D mirrored_depth;

// The reflection in the ground at a surface point; alpha is the share of objects in it. The cone of directions that a
// rough ground reflects covers more of the picture the farther away the objects are, and the mip level blurs as many
// texels. Their distance is the mean over a ring, so that silhouettes are as soft outside as inside.
vec4 mirrored_at(Surface s) {
    View v = mirrored_views[0];
    vec4 clip = v.view_projection * vec4(s.position, 1.0);
    vec2 uv = clip.xy / clip.w * 0.5 + 0.5;
    float here = linear_depth(v, uv, clip.z / clip.w), sum = 0.0, count = 0.0;
    float widest = s.roughness * s.roughness * v.projection[1][1];  // of the cone, in heights of the picture
    for (int i = 0; i < 9; ++i) {
        float angle = 2.0 * PI * float(i) / 8.0;
        vec2 offset = i == 8 ? vec2(0.0) : 0.25 * widest * vec2(cos(angle) * v.viewport.y / v.viewport.x, sin(angle));
        float window_depth = textureLod(mirrored_depth, uv + offset, 0.0).r;
        if (is_nothing(window_depth)) continue;
        sum += clamp(1.0 - here / linear_depth(v, uv, window_depth), 0.0, 1.0);  // the part behind the mirror
        count += 1.0;
    }
    float texels = widest * v.viewport.y * sum / max(count, 1.0);
    return textureLod(mirrored, uv, log2(max(texels, 1.0)));
}
#endif

// `unshadowed` is the light that the catcher receives without shadows, as radiance of a white surface.
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
#elif defined(HAS_REFLECTIONS) || defined(MIRRORS)
    // Reflections that replace the environment's, which is already part of what the catcher shows.
#ifdef HAS_REFLECTIONS
    vec4 reflected = reflections_at_fragment();
    reflected.rgb *= reflected.a;
#else
    vec4 reflected = mirrored_at(s);
#endif
    vec3 change = reflected.rgb - light_from(reflect(-s.view_dir, s.normal), s.roughness) * reflected.a;
    radiance.rgb = clamp(radiance.rgb + change * (catcher_reflectance(s) * coverage), 0.0, MAX_HALF_FLOAT);
#endif
}
#else
#define begin_catcher(s, unshadowed)
#define end_catcher(s, coverage)
#endif
