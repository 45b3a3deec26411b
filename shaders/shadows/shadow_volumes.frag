// What the stencil lets through is in shadow.
out vec4 visibility;

void main() {
    visibility = vec4(0.0);
}
