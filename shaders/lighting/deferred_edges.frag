// Detects texels whose samples see different surfaces (A. Lauritzen, "Deferred Rendering for Current and Future
// Rendering Pipelines", 2010): their normals or materials differ, or the line between their positions leaves the
// tangent plane.
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

bool differs(sampler2DMS map, ivec2 texel, int sample_index) {
    vec4 difference = texelFetch(map, texel, sample_index) - texelFetch(map, texel, 0);
    return any(greaterThan(abs(difference), vec4(0.5 / 255.0)));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float depth0 = texelFetch(depth, texel, 0).r;
    bool is_background = is_nothing(depth0), is_edge = false;
#ifdef HAS_NORMAL
    View view = depth_views[0];
    vec3 normal0 = normalize(texelFetch(normal, texel, 0).xyz), view_normal0 = mat3(view.view) * normal0;
    vec3 position0 = view_space_position(view, (vec2(texel) + DEPTH_SAMPLE_POSITIONS[0]) * view.viewport.zw, depth0);
    float min_cos_normals = cos(radians(normal_angle)), max_sin_elevation = sin(radians(depth_angle));
#endif
    for (int i = 1; i < DEPTH_SAMPLES; ++i) {
        float window_depth = texelFetch(depth, texel, i).r;
        is_edge = is_edge || is_background != is_nothing(window_depth) || differs(albedo, texel, i);
#ifdef HAS_MATERIAL
        is_edge = is_edge || differs(material, texel, i);
#endif
#ifdef HAS_EMISSIVE
        is_edge = is_edge || differs(emissive, texel, i);
#endif
#ifdef HAS_SPECULAR
        is_edge = is_edge || differs(specular, texel, i);
#endif
#ifdef HAS_NORMAL
        vec2 uv = (vec2(texel) + DEPTH_SAMPLE_POSITIONS[i]) * view.viewport.zw;
        vec3 offset = view_space_position(view, uv, window_depth) - position0;
        bool normals_differ = dot(normalize(texelFetch(normal, texel, i).xyz), normal0) < min_cos_normals;
        bool leaves_plane = abs(dot(offset, view_normal0)) > max_sin_elevation * length(offset);
        is_edge = is_edge || !is_background && (normals_differ || leaves_plane);
#endif
    }
    edges = is_edge ? 1.0 : 0.0;
}
