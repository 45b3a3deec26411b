// Converts the G-buffer and the light of a picture with another view to one layer of `beyond_views.glsl`.
#include "surfaces.glsl"
uniform sampler2D depth;
uniform sampler2D normal;  // world space
uniform sampler2D diffuse;
out vec4 surfaces;
out vec4 light;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float window_depth = texelFetch(depth, texel, 0).r;
    light = vec4(texelFetch(diffuse, texel, 0).rgb, 1.0);
    surfaces = vec4(0.0);
    if (is_nothing(window_depth)) return;
    vec3 view_normal = mat3(depth_views[0].view) * texelFetch(normal, texel, 0).xyz;
    surfaces = vec4(normalize(view_normal), linear_depth(depth_views[0], window_depth));
}
