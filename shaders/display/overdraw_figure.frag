// One channel of one texel.
uniform sampler2D source;
uniform int channel;
out float figure;

void main() {
    figure = texelFetch(source, ivec2(0), 0)[channel];
}
