// Whether the samples of a texel see different surfaces (A. Lauritzen, "Deferred Rendering for Current and Future
// Rendering Pipelines", 2010): other normals or materials, or a way from one to the other that leaves the surface.
#include <depth_surface.glsl>

uniform sampler2DMS albedo;
#ifdef HAS_MATERIAL
uniform sampler2DMS material;
#endif
#ifdef HAS_EMISSIVE
uniform sampler2DMS emissive;
#endif
#ifdef HAS_SPECULAR
uniform sampler2DMS specular;
#endif
#ifdef HAS_NORMAL
uniform sampler2DMS normal;
#endif
uniform float normal_angle;  // degrees
uniform float depth_angle;   // degrees
out float edges;

bool differs(sampler2DMS stored, ivec2 texel, int number) {
    vec4 difference = texelFetch(stored, texel, number) - texelFetch(stored, texel, 0);
    return any(greaterThan(abs(difference), vec4(0.5 / 255.0)));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float d = texelFetch(depth, texel, 0).r;
    bool nothing = is_nothing(d), found = false;
#ifdef HAS_NORMAL
    View v = depth_views[0];
    vec3 up = normalize(texelFetch(normal, texel, 0).xyz), across = mat3(v.view) * up;
    vec3 position = view_space_position(v, (vec2(texel) + DEPTH_SAMPLE_POSITIONS[0]) * v.viewport.zw, d);
    float alike = cos(radians(normal_angle)), steep = sin(radians(depth_angle));
#endif
    for (int i = 1; i < DEPTH_SAMPLES; ++i) {
        float other = texelFetch(depth, texel, i).r;
        found = found || nothing != is_nothing(other) || differs(albedo, texel, i);
#ifdef HAS_MATERIAL
        found = found || differs(material, texel, i);
#endif
#ifdef HAS_EMISSIVE
        found = found || differs(emissive, texel, i);
#endif
#ifdef HAS_SPECULAR
        found = found || differs(specular, texel, i);
#endif
#ifdef HAS_NORMAL
        vec3 away = view_space_position(v, (vec2(texel) + DEPTH_SAMPLE_POSITIONS[i]) * v.viewport.zw, other) - position;
        bool turned = dot(normalize(texelFetch(normal, texel, i).xyz), up) < alike;
        found = found || !nothing && (turned || abs(dot(away, across)) > steep * length(away));
#endif
    }
    edges = found ? 1.0 : 0.0;
}
