// A heat map of counts, with a legend of numbered steps at the lower left.
#include <text.glsl>

uniform sampler2D count;
uniform int top;  // the count with the last colour
out vec4 color;

// Black for 0, then blue, green, yellow, red and white from 1 to `top`.
vec3 heat_color(float count) {
    if (count < 0.5) return vec3(0.0);
    const vec3 stops[6] = vec3[](
        vec3(0.10, 0.15, 0.55), vec3(0.05, 0.50, 0.75), vec3(0.15, 0.65, 0.25), vec3(0.90, 0.80, 0.10),
        vec3(0.85, 0.15, 0.10), vec3(1.0, 1.0, 1.0));
    float position = clamp((count - 1.0) / float(top - 1), 0.0, 1.0) * 5.0;
    int stop = min(int(position), 4);
    return mix(stops[stop], stops[stop + 1], position - float(stop));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy), size = textureSize(count, 0);
    color = vec4(heat_color(texelFetch(count, texel, 0).r), 1.0);

    int scale = max(1, size.y / 180);  // texels per font pixel
    int step_size = 11 * scale;        // of the legend, in texels
    int step_count = min(top, size.x / step_size);
    ivec2 legend_texel = texel - 2 * scale;
    if (any(lessThan(legend_texel, ivec2(0))) || legend_texel.y >= step_size
        || legend_texel.x >= step_count * step_size) return;
    int number = legend_texel.x / step_size + 1;
    color.rgb = heat_color(float(number));
    ivec2 pixel = ivec2(legend_texel.x % step_size, legend_texel.y) / scale;
    bool is_digit = number < 10 ? glyph_pixel(number, pixel - ivec2(4, 3)) :
        glyph_pixel(number / 10, pixel - ivec2(2, 3)) || glyph_pixel(number % 10, pixel - ivec2(6, 3));
    if (is_digit) color.rgb = dot(color.rgb, vec3(0.2126, 0.7152, 0.0722)) > 0.4 ? vec3(0.0) : vec3(1.0);
}
