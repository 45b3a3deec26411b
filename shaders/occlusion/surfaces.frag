// Converts depth and world-space normals to view-space surfaces, at the size that occlusion is computed at.
#include "surfaces.glsl"
uniform sampler2D depth;
uniform sampler2D normal;  // world space
uniform ivec2 reduced_size;  // of the target
out vec4 surfaces;

void main() {
    ivec2 texel = screen_texel(ivec2(gl_FragCoord.xy), reduced_size, textureSize(depth, 0));
    float window_depth = texelFetch(depth, texel, 0).r;
    surfaces = vec4(0.0);
    if (is_nothing(window_depth)) return;
    vec3 view_normal = mat3(depth_views[0].view) * texelFetch(normal, texel, 0).xyz;
    surfaces = vec4(normalize(view_normal), linear_depth(depth_views[0], window_depth));
}
