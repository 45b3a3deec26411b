// Lights every pixel of a G-buffer. With DIRECTIONALS_ONLY the other lights follow in later passes.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>
#include "light_outputs.glsl"

uniform vec3 background;
#ifdef WRITES_SHADOW_DIFFERENCE
out float shadow_difference;  // of visibility between two sample positions; 1 where samples see different surfaces
#endif
#ifdef SHADE_ONCE
uniform sampler2D edges;  // 1 where samples differ: sample 0 is shaded there, and the texel's centre elsewhere
#endif

#ifdef WRITES_SHADOW_DIFFERENCE
// The sample closest to the point opposite a sample, with respect to the pixel's centre.
int opposite_sample(int sample_index) {
    vec2 opposite = 1.0 - DEPTH_SAMPLE_POSITIONS[sample_index];
    int nearest = 0;
    for (int i = 1; i < DEPTH_SAMPLES; ++i) {
        if (distance(DEPTH_SAMPLE_POSITIONS[i], opposite) < distance(DEPTH_SAMPLE_POSITIONS[nearest], opposite)) {
            nearest = i;
        }
    }
    return nearest;
}
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int sample_index = SAMPLE_INDEX;
#ifdef ONE_SAMPLE
    gl_SampleMask[0] = 1 << sample_index;
#endif
#ifdef SHADE_ONCE
    if (texelFetch(edges, texel, 0).r > 0.5) sample_index = 0;
#endif
    Surface s;
#ifdef WRITES_SHADOW_DIFFERENCE
    shadow_difference = sample_index == 0 ? 1.0 : 0.0;
#endif
    if (!surface_at(texel, sample_index, s)) {
#ifdef BACKDROP  // a later pass draws it
        write_background(vec4(0.0));
#else
        write_background(vec4(background, 0.0));
#endif
        return;
    }
    if (s.lit > 0.0) {
#ifdef WRITES_SHADOW_DIFFERENCE
        int first = sample_index == TEXEL_CENTER ? (texel.x + texel.y) % (DEPTH_SAMPLES / 2) : 0;
        for (int i = 0; i < 2; ++i) {
            float window_depth;
            int shadow_sample = i == 0 || sample_index == 0 ? first : opposite_sample(first);
            shadow_positions[i] = position_at_sample(texel, shadow_sample, window_depth);
            shadow_normals[i] = geometric_normal_at(texel, shadow_sample, shadow_positions[i], window_depth);
        }
#endif
        ReflectedLight direct = direct_lighting(s);
        ReflectedLight environment = environment_lighting(s);
        write_light(s, direct, environment);
#ifdef WRITES_SHADOW_DIFFERENCE
        if (sample_index != 0 && unshadowed_luminance > 0.0) {
            shadow_difference = min(luminance_difference / unshadowed_luminance, 254.0 / 255.0);
        }
#endif
    } else {
        write_unlit(s);
    }
}
