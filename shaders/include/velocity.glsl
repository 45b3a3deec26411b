// Motion on the screen, for temporal techniques.

// Screen-space motion since the previous frame, in widths and heights of the picture and without jitter: the current
// position minus the previous one. Both positions are in the clip space of their own view. (2, 2), which is outside any
// picture, where the previous position was behind the viewer.
vec2 velocity_between(vec4 clip_position, View view, vec4 previous_clip_position, View previous_view) {
    vec2 position = 0.5 * clip_position.xy / clip_position.w - view.jitter.xy;
    if (previous_clip_position.w <= 0.0) return vec2(2.0);  // it was behind the camera, so it was not visible anywhere
    return position - (0.5 * previous_clip_position.xy / previous_clip_position.w - previous_view.jitter.xy);
}

// The same for a static point at a window position and depth. The background is infinitely far away.
vec2 static_velocity(View view, View previous_view, vec2 uv, float depth) {
    vec4 clip_position = vec4(uv * 2.0 - 1.0, depth, 1.0);
    vec3 position = world_position(view, uv, depth);
    vec4 point = vec4(position, 1.0);
    if (is_nothing(depth) && view.eye.w > 0.0) point = vec4(position - view.eye.xyz, 0.0);
    return velocity_between(clip_position, view, previous_view.view_projection * point, previous_view);
}
