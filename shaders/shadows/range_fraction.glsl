// A window depth as the fraction of a view's range, from 0 at its near plane to 1 at its far one, also in perspective:
// what is averaged has to grow evenly with distance.
float range_fraction(View view, float depth) {
    return (linear_depth(view, depth) - view.range.x) / (view.range.y - view.range.x);
}
