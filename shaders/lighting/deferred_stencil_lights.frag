// Lights the pixels of a G-buffer that pass the stencil test, with one point or spot light.
#include <gbuffer_surface.glsl>
#include <lighting.glsl>

uniform int light;  // the scene's index
out vec4 radiance;
#ifdef WRITES_DIFFUSE
out vec4 diffuse;  // the same without the specular part
#endif

void main() {
    Surface s;
    radiance = vec4(0.0);  // no discard, because the stencil must be reset here, too
#ifdef WRITES_DIFFUSE
    diffuse = radiance;
#endif
    if (surface_at(ivec2(gl_FragCoord.xy), SAMPLE_INDEX, s) && s.lit > 0.0) {
        ReflectedLight direct = direct_lighting(s, light);
        radiance.rgb = min(selected_terms(direct), MAX_HALF_FLOAT);
#ifdef WRITES_DIFFUSE
        diffuse.rgb = min(selected_terms(diffuse_only(direct)), MAX_HALF_FLOAT);
#endif
    }
}
