// Edges found in the finished picture, and smoothed along themselves.
/*---
doc: |
  Smooth the edges of a finished picture by what it shows alone.

  This is FXAA (Lottes 2009, with the search along edges of 2011). Where brightness changes by more than a share of
  itself, the edge is followed both ways to where it ends; a pixel takes as much of its neighbour across the edge as a
  straight line from end to end would cover. It costs one pass and no more memory, works on highlights and masks as on
  silhouettes, and knows nothing of what is smaller than a pixel.
inputs:
  source: {semantic: display_color, filter: linear, doc: "The finished picture, as it is seen."}
outputs:
  color: {semantic: display_color, like: source, doc: "The same with smooth edges; alpha as it was."}
params:
  contrast: {default: 0.125, min: 0, max: 1, doc: "Share of the brightest neighbour by which an edge must differ."}
  darkest: {default: 0.03125, min: 0, max: 1, doc: "Least difference of brightness that counts, in the dark."}
  softness: {default: 0.75, min: 0, max: 1, doc: "How much single pixels that stand out are blended with all around."}
  reach: {default: 12, min: 1, max: 64, unit: texels, doc: How far an edge is followed each way.}
---*/
uniform sampler2D source;
uniform float contrast;
uniform float darkest;
uniform float softness;
uniform int reach;
out vec4 color;

float brightness(vec3 c) {
    return dot(c, vec3(0.299, 0.587, 0.114));  // of encoded colour (ITU-R BT.601)
}

float bright_at(ivec2 texel) {
    return brightness(texelFetch(source, clamp(texel, ivec2(0), textureSize(source, 0) - 1), 0).rgb);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    color = texelFetch(source, texel, 0);
    float here = brightness(color.rgb);
    float up = bright_at(texel + ivec2(0, 1)), down = bright_at(texel - ivec2(0, 1));
    float right = bright_at(texel + ivec2(1, 0)), left = bright_at(texel - ivec2(1, 0));
    float most = max(here, max(max(up, down), max(left, right)));
    float range = most - min(here, min(min(up, down), min(left, right)));
    if (range < max(darkest, most * contrast)) return;

    float up_left = bright_at(texel + ivec2(-1, 1)), up_right = bright_at(texel + ivec2(1, 1));
    float down_left = bright_at(texel - ivec2(1, 1)), down_right = bright_at(texel + ivec2(1, -1));

    // The edge runs along the axis across which brightness bends more.
    float bend_up = abs(up_left - 2.0 * left + down_left) + 2.0 * abs(up - 2.0 * here + down) +
        abs(up_right - 2.0 * right + down_right);
    float bend_side = abs(up_left - 2.0 * up + up_right) + 2.0 * abs(left - 2.0 * here + right) +
        abs(down_left - 2.0 * down + down_right);
    bool level = bend_up >= bend_side;
    ivec2 across = level ? ivec2(0, 1) : ivec2(1, 0);
    ivec2 along = across.yx;

    // The neighbour across it, on the side of the steeper step.
    float before = level ? down : left, after = level ? up : right;
    bool is_before = abs(before - here) >= abs(after - here);
    if (is_before) across = -across;
    float other = is_before ? before : after;
    float edge = 0.5 * (here + other);
    float step_size = 0.25 * abs(other - here);

    // Both ways along the edge, until the pair of pixels beside it is no longer brighter or darker alike.
    int ends[2] = int[](reach, reach);
    float off[2] = float[](0.0, 0.0);
    for (int way = 0; way < 2; ++way) {
        ivec2 going = way == 0 ? -along : along;
        for (int i = 1; i <= reach; ++i) {
            ivec2 at = texel + going * i;
            off[way] = 0.5 * (bright_at(at) + bright_at(at + across)) - edge;
            if (abs(off[way]) >= step_size) {
                ends[way] = i;
                break;
            }
        }
    }
    int nearest = ends[0] < ends[1] ? 0 : 1;
    // Only the half of the edge on which this pixel is the odd one takes of its neighbour.
    bool odd = (here - edge < 0.0) != (off[nearest] < 0.0);
    float share = odd ? 0.5 - float(ends[nearest]) / float(ends[0] + ends[1]) : 0.0;

    float mean = (2.0 * (up + down + left + right) + up_left + up_right + down_left + down_right) / 12.0;
    float alone = smoothstep(0.0, 1.0, clamp(abs(mean - here) / range, 0.0, 1.0));
    share = max(share, alone * alone * softness);
    vec2 place = (vec2(texel) + 0.5 + vec2(across) * share) / vec2(textureSize(source, 0));
    color.rgb = texture(source, place).rgb;
}
