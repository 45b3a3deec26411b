// What lies beside the picture, in other views from the same eye: the picture's plane goes on there. A layer a view.
uniform sampler2DArray beyond_surfaces;  // as each sees them
uniform sampler2DArray beyond_light;

// Whether any of the views shows something at a `place` of the window outside of 0 to 1: then that surface, its
// position in the picture's view space, and its texel.
bool seen_beyond(View v, vec2 place, out vec4 seen, out vec3 at, out ivec3 texel) {
    vec3 along = mat3(v.inverse_view) * view_position(v, place, 1.0);
    ivec2 size = textureSize(beyond_surfaces, 0).xy;
    for (int k = 0; k < BEYOND; ++k) {
        vec4 clip = beyond_surfaces_views[k].projection * vec4(mat3(beyond_surfaces_views[k].view) * along, 1.0);
        if (clip.w <= 0.0 || any(greaterThan(abs(clip.xy), vec2(clip.w)))) continue;
        texel = ivec3(min(ivec2((clip.xy / clip.w * 0.5 + 0.5) * vec2(size)), size - 1), k);
        seen = texelFetch(beyond_surfaces, texel, 0);
        if (seen.w == 0.0) return false;
        mat3 turn = mat3(v.view) * transpose(mat3(beyond_surfaces_views[k].view));
        at = turn * view_position(beyond_surfaces_views[k], (vec2(texel.xy) + 0.5) / vec2(size), seen.w);
        seen = vec4(turn * seen.xyz, -at.z);
        return seen.w > 0.0;
    }
    return false;
}
