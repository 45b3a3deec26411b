// Light at every pixel of a G-buffer. With DIRECTIONALS_ONLY the other lights come later.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>

uniform vec3 background;
out vec4 radiance;  // scene-linear; alpha is coverage
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without its specular part
#endif
#ifdef WRITES_LIT_SHARE
out float lit_share;  // of the light that would reach the surface without shadows
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    Surface s;
#ifdef WRITES_LIT_SHARE
    lit_share = 1.0;
#endif
    if (!surface_at(texel, HERE, s)) {
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
        Reflected light = reflected_lights(s);
        Reflected around = light_around(s);
        radiance = vec4(radiance_of(s, light, around), 1.0);
#ifdef WRITES_LIT_SHARE
        if (could_reach > 0.0) lit_share = does_reach / could_reach;
#endif
#ifdef WRITES_DIFFUSE
        diffuse = vec4(radiance_of(s, without_specular(light), without_specular(around)), 1.0);
#endif
    } else {
        radiance = vec4(unlit_radiance(s), 1.0);
#ifdef WRITES_DIFFUSE
        diffuse = radiance;
#endif
    }
}
