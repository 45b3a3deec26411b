// Texture coordinates and depth as metres behind a view's near plane, in any projection.
float view_depth(View view, vec3 place) {
    return linear_depth(view, place.xy, place.z) - view.range.x;
}
