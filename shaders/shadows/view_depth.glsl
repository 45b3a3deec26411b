// Distance in metres from a view's near plane, for any projection. `coords` are texture coordinates and window depth.
float view_depth(View view, vec3 coords) {
    return linear_depth(view, coords.xy, coords.z) - view.range.x;
}
