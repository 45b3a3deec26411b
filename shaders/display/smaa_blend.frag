// Each pixel mixed with the neighbour that it takes most of, in display light.
#include <srgb.glsl>
uniform sampler2D source;
uniform sampler2D weights;
out vec4 color;

vec4 weights_at(ivec2 texel) {
    return texel == min(texel, textureSize(weights, 0) - 1) ? texelFetch(weights, texel, 0) : vec4(0.0);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    color = texelFetch(source, texel, 0);
    vec4 own = weights_at(texel);
    // Below, above; left, right.
    vec4 takes = vec4(own.x, weights_at(texel + ivec2(0, 1)).y, own.z, weights_at(texel + ivec2(1, 0)).w);
    bool level = max(takes.x, takes.y) >= max(takes.z, takes.w);
    vec2 pair = level ? takes.xy : takes.zw;
    if (pair.x + pair.y == 0.0) return;
    ivec2 way = level ? ivec2(0, 1) : ivec2(1, 0);
    ivec2 last = textureSize(source, 0) - 1;
    vec3 before = srgb_to_linear(texelFetch(source, max(texel - way, ivec2(0)), 0).rgb);
    vec3 after = srgb_to_linear(texelFetch(source, min(texel + way, last), 0).rgb);
    vec3 here = srgb_to_linear(color.rgb);
    color.rgb = linear_to_srgb(here + pair.x * (before - here) + pair.y * (after - here));
}
