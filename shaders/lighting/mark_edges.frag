// Lets through what is to be marked.
uniform sampler2D edges;

void main() {
    if (texelFetch(edges, ivec2(gl_FragCoord.xy), 0).r < 0.5) discard;
}
