// How much of a pixel lies between an edge and the straight line that stands for its stairs, for every way to the
// edge's ends and what crosses there (J. Jimenez et al., "SMAA", 2012). A line begins half a pixel up or down at an end
// where another edge goes on there, and runs to the other end, or to the middle and back where both go to one side.
uniform int side;
out vec2 areas;  // above the edge, and below

// Area above 0 under the part of a line from a to b that lies between two places.
float area_under(vec2 a, vec2 b, float from, float to) {
    from = max(from, a.x);
    to = min(to, b.x);
    if (to <= from) return 0.0;
    float slope = (b.y - a.y) / (b.x - a.x);
    float y0 = a.y + slope * (from - a.x), y1 = a.y + slope * (to - a.x);
    if (y0 <= 0.0 && y1 <= 0.0) return 0.0;
    if (y0 >= 0.0 && y1 >= 0.0) return 0.5 * (y0 + y1) * (to - from);
    float peak = max(y0, y1);
    return 0.5 * peak * peak / abs(slope);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int shape = texel.x / side;
    float before = float(texel.x % side), after = float(texel.y), whole = before + after + 1.0;
    vec2 ends = 0.5 * vec2(shape / 3 - 1, shape % 3 - 1);
    vec2 a = vec2(0.0, ends.x), middle = vec2(0.5 * whole, 0.0), b = vec2(whole, ends.y);
    vec2 flip = vec2(1.0, -1.0);
    float from = before, to = before + 1.0;
    if (ends.x * ends.y < 0.0) {
        areas = vec2(area_under(a, b, from, to), area_under(a * flip, b * flip, from, to));
    } else {
        areas.x = area_under(a, middle, from, to) + area_under(middle, b, from, to);
        areas.y = area_under(a * flip, middle, from, to) + area_under(middle, b * flip, from, to);
    }
}
