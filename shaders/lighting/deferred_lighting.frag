// Light at every pixel of a G-buffer. With DIRECTIONALS_ONLY the other lights come later.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>

uniform vec3 background;
out vec4 radiance;  // scene-linear; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without its specular part
#endif
#ifdef WRITES_SHADOW_DIFFERENCE
out float shadow_difference;  // between two places of what shadows leave of the light; 1 where surfaces differ
#endif
#ifdef LIT_ONCE
uniform sampler2D edges;  // 1 where samples differ: there the first is lit, and the middle of all elsewhere
#endif

#ifdef WRITES_SHADOW_DIFFERENCE
// The sample that is nearest to the other side of the middle.
int opposite(int number) {
    vec2 other = 1.0 - DEPTH_SAMPLE_POSITIONS[number];
    int nearest = 0;
    for (int i = 1; i < DEPTH_SAMPLES; ++i) {
        if (distance(DEPTH_SAMPLE_POSITIONS[i], other) < distance(DEPTH_SAMPLE_POSITIONS[nearest], other)) nearest = i;
    }
    return nearest;
}
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int number = SAMPLE_INDEX;
#ifdef ONE_SAMPLE
    gl_SampleMask[0] = 1 << number;
#endif
#ifdef LIT_ONCE
    if (texelFetch(edges, texel, 0).r > 0.5) number = 0;
#endif
    Surface s;
#ifdef WRITES_SHADOW_DIFFERENCE
    shadow_difference = number == 0 ? 1.0 : 0.0;
#endif
    if (!surface_at(texel, number, s)) {
#ifdef BACKDROP  // comes after
        radiance = vec4(0.0);
#else
        radiance = vec4(background, 0.0);
#endif
#ifdef WRITES_DIFFUSE
        diffuse = radiance;
#endif
        return;
    }
    if (s.lit > 0.0) {
#ifdef WRITES_SHADOW_DIFFERENCE
        int first = number == TEXEL_CENTER ? (texel.x + texel.y) % (DEPTH_SAMPLES / 2) : 0;
        for (int i = 0; i < 2; ++i) {
            float d;
            int place = i == 0 || number == 0 ? first : opposite(first);
            shadow_positions[i] = position_at_sample(texel, place, d);
            shadow_normals[i] = geometric_normal_at(texel, place, shadow_positions[i], d);
        }
#endif
        ReflectedLight light = direct_lighting(s);
        ReflectedLight around = environment_lighting(s);
        radiance = vec4(radiance_of(s, light, around), 1.0);
#ifdef WRITES_SHADOW_DIFFERENCE
        if (number != 0 && could_reach > 0.0) shadow_difference = min(changing / could_reach, 254.0 / 255.0);
#endif
#ifdef WRITES_DIFFUSE
        diffuse = vec4(radiance_of(s, diffuse_only(light), diffuse_only(around)), 1.0);
#endif
    } else {
        radiance = vec4(unlit_radiance(s), 1.0);
#ifdef WRITES_DIFFUSE
        diffuse = radiance;
#endif
    }
}
