// Pixels that pass the stencil test are in shadow.
out vec4 visibility;

void main() {
    visibility = vec4(0.0);
}
