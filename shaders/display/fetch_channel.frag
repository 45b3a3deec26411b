// One channel of the first texel.
uniform sampler2D source;
uniform int channel;
out float value;

void main() {
    value = texelFetch(source, ivec2(0), 0)[channel];
}
