// Whether the samples of a texel see different surfaces (A. Lauritzen, "Deferred Rendering for Current and Future
// Rendering Pipelines", 2010): other normals or colours, or a way from one to the other that leaves the surface.
#include <depth_surface.glsl>

uniform sampler2DMS albedo;
#ifdef HAS_NORMAL
uniform sampler2DMS normal;
#endif
uniform float normal_angle;  // degrees
uniform float depth_angle;   // degrees
out float edges;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float d, other;
    vec3 position = position_at(texel, 0, d);
    vec3 color = texelFetch(albedo, texel, 0).rgb;
#ifdef HAS_NORMAL
    vec3 up = normalize(texelFetch(normal, texel, 0).xyz);
    float alike = cos(radians(normal_angle)), steep = sin(radians(depth_angle));
#endif
    edges = 0.0;
    for (int i = 1; i < DEPTH_SAMPLES; ++i) {
        vec3 away = position_at(texel, i, other) - position;
        if (is_nothing(d) != is_nothing(other)) edges = 1.0;
        if (is_nothing(d) || is_nothing(other)) continue;
        if (any(greaterThan(abs(texelFetch(albedo, texel, i).rgb - color), vec3(0.5 / 255.0)))) edges = 1.0;
#ifdef HAS_NORMAL
        if (dot(normalize(texelFetch(normal, texel, i).xyz), up) < alike) edges = 1.0;
        if (abs(dot(away, up)) > steep * length(away)) edges = 1.0;
#endif
    }
}
