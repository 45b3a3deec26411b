// The area table of SMAA: how much of a pixel lies between an edge and the line that replaces its staircase, for all
// distances to the ends of the edge and all crossing edges there (J. Jimenez et al., "SMAA", 2012). A line starts half
// a pixel up or down at an end with a crossing edge on that side, and runs to the other end; if both crossing edges are
// on the same side, it runs to the middle and back.
uniform int side;
out vec2 areas;  // above the edge, below it

// The area above 0 under the part of the line from a to b between two positions.
float area_under_line(vec2 a, vec2 b, float begin, float end) {
    begin = max(begin, a.x);
    end = min(end, b.x);
    if (end <= begin) return 0.0;
    float slope = (b.y - a.y) / (b.x - a.x);
    float y0 = a.y + slope * (begin - a.x), y1 = a.y + slope * (end - a.x);
    if (y0 <= 0.0 && y1 <= 0.0) return 0.0;
    if (y0 >= 0.0 && y1 >= 0.0) return 0.5 * (y0 + y1) * (end - begin);
    float peak = max(y0, y1);
    return 0.5 * peak * peak / abs(slope);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int pattern = texel.x / side;
    float distance_left = float(texel.x % side), distance_right = float(texel.y);
    float edge_length = distance_left + distance_right + 1.0;
    vec2 heights = 0.5 * vec2(pattern / 3 - 1, pattern % 3 - 1);  // of the line at both ends
    vec2 a = vec2(0.0, heights.x), middle = vec2(0.5 * edge_length, 0.0), b = vec2(edge_length, heights.y);
    vec2 flip = vec2(1.0, -1.0);
    float begin = distance_left, end = distance_left + 1.0;
    if (heights.x * heights.y < 0.0) {
        areas = vec2(area_under_line(a, b, begin, end), area_under_line(a * flip, b * flip, begin, end));
    } else {
        areas.x = area_under_line(a, middle, begin, end) + area_under_line(middle, b, begin, end);
        areas.y = area_under_line(a * flip, middle, begin, end) + area_under_line(middle, b * flip, begin, end);
    }
}
