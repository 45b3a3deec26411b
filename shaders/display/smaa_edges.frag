// Edge detection of SMAA: edges where the luma differs from that of the left and of the lower neighbour. An edge next
// to a much stronger one is dropped, because it belongs to the blur of that one (local contrast adaptation).
uniform sampler2D source;
uniform float threshold;
uniform float dominance;
out vec2 edges;  // 1 on the left, below

float luma_at(ivec2 texel) {
    texel = clamp(texel, ivec2(0), textureSize(source, 0) - 1);
    vec4 color = texelFetch(source, texel, 0);
#if TRANSPARENT
    color.rgb += color.a - 1.0;  // over a background darker than black, so that black surfaces have edges, too
#endif
    return dot(color.rgb, vec3(0.2126, 0.7152, 0.0722));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float center = luma_at(texel);
    float left = luma_at(texel - ivec2(1, 0)), below = luma_at(texel - ivec2(0, 1));
    vec2 difference = abs(center - vec2(left, below));
    vec2 previous = abs(vec2(left - luma_at(texel - ivec2(2, 0)), below - luma_at(texel - ivec2(0, 2))));
    vec2 next = abs(center - vec2(luma_at(texel + ivec2(1, 0)), luma_at(texel + ivec2(0, 1))));
    vec2 strongest = max(max(previous, next), difference.yx);
    edges = step(threshold, difference) * step(max(strongest.x, strongest.y), dominance * difference);
}
