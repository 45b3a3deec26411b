// Surfaces outside the screen, from other views with the same eye: they continue the picture's plane. One layer per
// view.
uniform sampler2DArray beyond_surfaces;  // in the space of each view
uniform sampler2DArray beyond_light;

// Finds the surface at window coordinates outside 0 to 1. Returns whether there is one; its normal and distance, its
// position in the camera's view space, and its texel.
bool find_beyond(View view, vec2 uv, out vec4 surface, out vec3 position, out ivec3 texel) {
    vec3 direction = mat3(view.inverse_view) * view_position(view, uv, 1.0);
    ivec2 size = textureSize(beyond_surfaces, 0).xy;
    for (int k = 0; k < BEYOND; ++k) {
        vec4 clip = beyond_surfaces_views[k].projection * vec4(mat3(beyond_surfaces_views[k].view) * direction, 1.0);
        if (clip.w <= 0.0 || any(greaterThan(abs(clip.xy), vec2(clip.w)))) continue;
        texel = ivec3(min(ivec2((clip.xy / clip.w * 0.5 + 0.5) * vec2(size)), size - 1), k);
        surface = texelFetch(beyond_surfaces, texel, 0);
        if (surface.w == 0.0) return false;
        mat3 rotation = mat3(view.view) * transpose(mat3(beyond_surfaces_views[k].view));
        vec2 texel_center = (vec2(texel.xy) + 0.5) / vec2(size);
        position = rotation * view_position(beyond_surfaces_views[k], texel_center, surface.w);
        surface = vec4(rotation * surface.xyz, -position.z);
        return surface.w > 0.0;
    }
    return false;
}
