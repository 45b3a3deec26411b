// How far what is at a place of the picture has moved since the frame before, in widths and heights of the picture, as
// if nothing were jittered: the place now less the place then.
vec2 velocity_between(vec4 now, View view, vec4 before, View previous) {
    vec2 here = 0.5 * now.xy / now.w - view.jitter.xy;
    if (before.w <= 0.0) return vec2(2.0);  // it was behind the eye, so it was seen nowhere
    return here - (0.5 * before.xy / before.w - previous.jitter.xy);
}

// The same of a point of the picture at a depth, of what stands still. Where nothing is, it is infinitely far away.
vec2 static_velocity(View view, View previous, vec2 uv, float depth) {
    vec4 now = vec4(uv * 2.0 - 1.0, depth, 1.0);
    vec3 position = world_position(view, uv, depth);
    vec4 point = vec4(position, 1.0);
    if (is_nothing(depth) && view.eye.w > 0.0) point = vec4(position - view.eye.xyz, 0.0);
    return velocity_between(now, view, previous.view_projection * point, previous);
}
