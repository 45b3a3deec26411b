// Discards texels that are not edges, so that the stencil marks only edges.
uniform sampler2D edges;

void main() {
    if (texelFetch(edges, ivec2(gl_FragCoord.xy), 0).r < 0.5) discard;
}
