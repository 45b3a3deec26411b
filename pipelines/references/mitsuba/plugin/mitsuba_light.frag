// Copies what Mitsuba has traced, the top row first, into textures.
layout(std430) readonly buffer traced { float values[]; };  // radiance and its variance, six floats a pixel
uniform float taken;
out vec4 radiance, variance;
out float samples_taken;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    int first = 6 * ((HEIGHT - 1 - at.y) * WIDTH + at.x);
    radiance = vec4(values[first], values[first + 1], values[first + 2], 1.0);
    variance = vec4(values[first + 3], values[first + 4], values[first + 5], 0.0);
    samples_taken = taken;
}
