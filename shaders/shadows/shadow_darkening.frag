// How much of the picture goes where the stencil lets through.
uniform float strength;
out vec4 radiance;

void main() {
    radiance = vec4(0.0, 0.0, 0.0, strength);
}
