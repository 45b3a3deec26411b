// Fast approximate antialiasing (FXAA): finds edges in the finished picture, and smooths along them.
/*---
doc: |
  Smooth the edges of a finished picture, in one pass.

  This is FXAA (Lottes 2009, with the search along edges of 2011). Where the luma changes by more than a fraction of
  itself, both ends of the edge are searched, and a pixel is blended with its neighbour across the edge, by the area
  that a straight line from end to end would cover. It needs no further memory, and treats highlights and alpha masks
  like silhouettes; details smaller than a pixel are lost.
inputs:
  source: {semantic: display_color, filter: linear, doc: "The finished picture, display-referred."}
outputs:
  color: {semantic: display_color, like: source, doc: "The picture with smooth edges, in alpha, too."}
params:
  contrast: {default: 0.125, min: 0, max: 1, doc: "Least difference at an edge, relative to the brightest neighbour."}
  darkest: {default: 0.03125, min: 0, max: 1, doc: "Least difference of luma at an edge in dark regions."}
  softness: {default: 0.75, min: 0, max: 1, doc: "Blending of single outlier pixels with their surroundings."}
  reach: {default: 12, min: 1, max: 64, unit: texels, doc: How far to search along an edge on each side.}
  transparent: {role: define, default: false, doc: "Detect edges in alpha, too; colours are premultiplied by it."}
---*/
uniform sampler2D source;
uniform float contrast;
uniform float darkest;
uniform float softness;
uniform int reach;
out vec4 color;

float luma(vec4 c) {
#if TRANSPARENT
    c.rgb += c.a - 1.0;  // over a background darker than black, so that black surfaces have edges, too
#endif
    return dot(c.rgb, vec3(0.299, 0.587, 0.114));  // of encoded colour (ITU-R BT.601)
}

float luma_at(ivec2 texel) {
    return luma(texelFetch(source, clamp(texel, ivec2(0), textureSize(source, 0) - 1), 0));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    color = texelFetch(source, texel, 0);
    float center = luma(color);
    float up = luma_at(texel + ivec2(0, 1)), down = luma_at(texel - ivec2(0, 1));
    float right = luma_at(texel + ivec2(1, 0)), left = luma_at(texel - ivec2(1, 0));
    float maximum = max(center, max(max(up, down), max(left, right)));
    float range = maximum - min(center, min(min(up, down), min(left, right)));
    if (range < max(darkest, maximum * contrast)) return;

    float up_left = luma_at(texel + ivec2(-1, 1)), up_right = luma_at(texel + ivec2(1, 1));
    float down_left = luma_at(texel - ivec2(1, 1)), down_right = luma_at(texel + ivec2(1, -1));

    // The edge is perpendicular to the axis with the larger second difference.
    float vertical_change = abs(up_left - 2.0 * left + down_left) + 2.0 * abs(up - 2.0 * center + down) +
        abs(up_right - 2.0 * right + down_right);
    float horizontal_change = abs(up_left - 2.0 * up + up_right) + 2.0 * abs(left - 2.0 * center + right) +
        abs(down_left - 2.0 * down + down_right);
    bool is_horizontal = vertical_change >= horizontal_change;
    ivec2 normal = is_horizontal ? ivec2(0, 1) : ivec2(1, 0);
    ivec2 tangent = normal.yx;

    // The normal points to the neighbour with the larger difference.
    float negative = is_horizontal ? down : left, positive = is_horizontal ? up : right;
    bool is_negative = abs(negative - center) >= abs(positive - center);
    if (is_negative) normal = -normal;
    float neighbor = is_negative ? negative : positive;
    float edge_luma = 0.5 * (center + neighbor);
    float gradient = 0.25 * abs(neighbor - center);

    // Searches both ends of the edge: where the mean of the two pixels beside it differs from that at the start.
    int distances[2] = int[](reach, reach);
    float end_differences[2] = float[](0.0, 0.0);
    for (int side = 0; side < 2; ++side) {
        ivec2 direction = side == 0 ? -tangent : tangent;
        for (int i = 1; i <= reach; ++i) {
            ivec2 sample_texel = texel + direction * i;
            end_differences[side] = 0.5 * (luma_at(sample_texel) + luma_at(sample_texel + normal)) - edge_luma;
            if (abs(end_differences[side]) >= gradient) {
                distances[side] = i;
                break;
            }
        }
    }
    int nearest = distances[0] < distances[1] ? 0 : 1;
    // Only pixels on the side of the edge that the nearer end does not continue are blended.
    bool is_blended = (center - edge_luma < 0.0) != (end_differences[nearest] < 0.0);
    float offset = is_blended ? 0.5 - float(distances[nearest]) / float(distances[0] + distances[1]) : 0.0;

    float mean = (2.0 * (up + down + left + right) + up_left + up_right + down_left + down_right) / 12.0;
    float subpixel = smoothstep(0.0, 1.0, clamp(abs(mean - center) / range, 0.0, 1.0));
    offset = max(offset, subpixel * subpixel * softness);
    vec2 uv = (vec2(texel) + 0.5 + vec2(normal) * offset) / vec2(textureSize(source, 0));
    color = texture(source, uv);
}
