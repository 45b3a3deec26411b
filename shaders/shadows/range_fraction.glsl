// Texture coordinates and depth as the fraction of a view's range, from 0 at its near plane to 1 at its far one, in any
// projection: what is averaged has to grow evenly with distance.
float range_fraction(View view, vec3 place) {
    return (linear_depth(view, place.xy, place.z) - view.range.x) / (view.range.y - view.range.x);
}
