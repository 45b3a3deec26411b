// Counts as colours, with a legend of numbered steps at the lower left.
#include <text.glsl>

uniform sampler2D count;
uniform int top;  // the count that has the last colour
out vec4 color;

// From blue by way of green and yellow to red, then white: n from 1 to `top`.
vec3 heat(float n) {
    if (n < 0.5) return vec3(0.0);
    const vec3 steps[6] = vec3[](
        vec3(0.10, 0.15, 0.55), vec3(0.05, 0.50, 0.75), vec3(0.15, 0.65, 0.25), vec3(0.90, 0.80, 0.10),
        vec3(0.85, 0.15, 0.10), vec3(1.0, 1.0, 1.0));
    float at = clamp((n - 1.0) / float(top - 1), 0.0, 1.0) * 5.0;
    int below = min(int(at), 4);
    return mix(steps[below], steps[below + 1], at - float(below));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy), size = textureSize(count, 0);
    color = vec4(heat(texelFetch(count, texel, 0).r), 1.0);

    int dots = max(1, size.y / 180);       // texels along a dot of a digit
    int side = 11 * dots;                  // of a step of the legend
    int shown = min(top, size.x / side);
    ivec2 at = texel - 2 * dots;
    if (at.x < 0 || at.y < 0 || at.y >= side || at.x >= shown * side) return;
    int n = at.x / side + 1;
    color.rgb = heat(float(n));
    ivec2 within = ivec2(at.x % side, at.y) / dots;
    bool marked = n < 10 ? glyph_pixel(n, within - ivec2(4, 3)) :
        glyph_pixel(n / 10, within - ivec2(2, 3)) || glyph_pixel(n % 10, within - ivec2(6, 3));
    if (marked) color.rgb = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722)) > 0.4 ? vec3(0.0) : vec3(1.0);
}
