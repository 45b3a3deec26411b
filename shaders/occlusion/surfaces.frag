// The surfaces of a G-buffer in view space, at the size that occlusion is computed at.
#include "surfaces.glsl"
uniform sampler2D depth;
uniform sampler2D normal;  // world space
uniform ivec2 reduced;     // size of the target
out vec4 surfaces;

void main() {
    ivec2 texel = texel_for(ivec2(gl_FragCoord.xy), reduced, textureSize(depth, 0));
    float d = texelFetch(depth, texel, 0).r;
    surfaces = vec4(0.0);
    if (is_nothing(d)) return;
    vec3 facing = mat3(depth_views[0].view) * texelFetch(normal, texel, 0).xyz;
    surfaces = vec4(normalize(facing), linear_depth(depth_views[0], d));
}
