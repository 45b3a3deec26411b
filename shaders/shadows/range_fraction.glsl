// Depth as a fraction of a view's range, from 0 at the near plane to 1 at the far plane and linear in distance for any
// projection, as filtering requires. `coords` are texture coordinates and window depth.
float range_fraction(View view, vec3 coords) {
    return (linear_depth(view, coords.xy, coords.z) - view.range.x) / (view.range.y - view.range.x);
}
