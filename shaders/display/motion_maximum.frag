// The longest of `count` vectors along an axis, for the maxima over tiles.
uniform sampler2D source;
uniform ivec2 axis;
uniform int count;
uniform int stride;
out vec2 longest;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) * (axis * (stride - 1) + 1), last = textureSize(source, 0) - 1;
    longest = vec2(0.0);
    for (int i = 0; i < count; ++i) {
        vec2 other = texelFetch(source, min(texel + axis * i, last), 0).xy;
        if (dot(other, other) > dot(longest, longest)) longest = other;
    }
}
