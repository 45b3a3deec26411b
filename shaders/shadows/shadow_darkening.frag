// Darkens the picture where the stencil test passes: alpha is the fraction of radiance that blending removes.
uniform float strength;
out vec4 radiance;

void main() {
    radiance = vec4(0.0, 0.0, 0.0, strength);
}
