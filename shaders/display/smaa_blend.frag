// Blends each pixel with its neighbours, in linear light, along the axis with the larger weight.
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
    // Of the neighbours below, above, on the left and on the right.
    vec4 neighbor_weights = vec4(
        own.x, weights_at(texel + ivec2(0, 1)).y, own.z, weights_at(texel + ivec2(1, 0)).w);
    bool is_vertical = max(neighbor_weights.x, neighbor_weights.y) >= max(neighbor_weights.z, neighbor_weights.w);
    vec2 pair = is_vertical ? neighbor_weights.xy : neighbor_weights.zw;
    if (pair.x + pair.y == 0.0) return;
    ivec2 step = is_vertical ? ivec2(0, 1) : ivec2(1, 0);
    ivec2 last = textureSize(source, 0) - 1;
#if TRANSPARENT
    vec4 previous = display_to_light(texelFetch(source, max(texel - step, ivec2(0)), 0));
    vec4 next = display_to_light(texelFetch(source, min(texel + step, last), 0));
    vec4 center = display_to_light(color);
    color = light_to_display(center + pair.x * (previous - center) + pair.y * (next - center));
#else
    vec3 previous = srgb_to_linear(texelFetch(source, max(texel - step, ivec2(0)), 0).rgb);
    vec3 next = srgb_to_linear(texelFetch(source, min(texel + step, last), 0).rgb);
    vec3 center = srgb_to_linear(color.rgb);
    color.rgb = linear_to_srgb(center + pair.x * (previous - center) + pair.y * (next - center));
#endif
}
