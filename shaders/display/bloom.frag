// Adds the mean of all mip levels of the glow to the picture, upsampled bilinearly.
uniform sampler2D glow;
uniform float intensity;
in vec2 v_uv;
out vec4 radiance;

void main() {
    vec3 sum = vec3(0.0);
    for (int level = 0; level < LEVELS; ++level) sum += textureLod(glow, v_uv, float(level)).rgb;
    radiance = vec4(sum * (intensity / float(LEVELS)), 0.0);
}
