// View-space surfaces, which screen-space techniques sample in place of the scene. Each texel holds a unit normal in
// view space and in w the distance along the view axis in metres, 0 for background. The texture may be smaller than the
// screen; each of its texels then holds the surface at one texel of the screen, not a mean of several.

// The texel of the screen that a texel of a texture of another `size` stands for. Divides floats, because some
// processors divide integer vectors one component after the other.
ivec2 full_size_texel(ivec2 texel, ivec2 size, ivec2 screen_size) {
    vec2 step = vec2(screen_size) / vec2(size);
    return ivec2((vec2(texel) + 0.5) * step + 0.25 / vec2(size));
}

// The same for textures of the size of `surfaces`, which without REDUCED is the screen's.
ivec2 screen_texel(ivec2 texel, ivec2 size, ivec2 screen_size) {
#ifdef REDUCED
    return full_size_texel(texel, size, screen_size);
#else
    return texel;
#endif
}

#ifdef SPARSE
uniform ivec2 reduced_size;  // of the target, which is smaller than `surfaces`
#endif

// The size of the target of a pass, given the size of `surfaces`.
ivec2 target_size(ivec2 surfaces_size) {
#ifdef SPARSE
    return reduced_size;
#else
    return surfaces_size;
#endif
}

// The texel of `surfaces` that a pixel of the target stands for.
ivec2 surface_texel(ivec2 pixel, ivec2 surfaces_size) {
#ifdef SPARSE
    return full_size_texel(pixel, reduced_size, surfaces_size);
#else
    return pixel;
#endif
}

// The same for the current pixel.
ivec2 current_surface_texel(ivec2 surfaces_size) {
    return surface_texel(ivec2(gl_FragCoord.xy), surfaces_size);
}

// Window coordinates (0 to 1) of the screen texel that a texel of `surfaces` stands for.
vec2 texel_uv(ivec2 texel, ivec2 size, ivec2 screen_size) {
    return (vec2(screen_texel(texel, size, screen_size)) + 0.5) / vec2(screen_size);
}

// The value of a texel, sampled at its centre: Mesa's rasteriser looks up the number of mip levels for each
// `texelFetch`, which takes half of the time.
vec4 fetch_texel(sampler2D source, ivec2 texel, ivec2 size) {
    return textureLod(source, (vec2(texel) + 0.5) / vec2(size), 0.0);
}

// Clip-space w at a distance along the view axis: the distance itself, or 1 for orthographic views.
float clip_w(View v, float distance) {
    return v.projection[3][3] - v.projection[2][3] * distance;
}

// View-space position from window coordinates (0 to 1) and the distance along the view axis.
vec3 view_position(View v, vec2 uv, float distance) {
    vec2 ndc = uv * 2.0 - 1.0;
    vec2 scaled = ndc * clip_w(v, distance) + v.projection[2].xy * distance - v.projection[3].xy;
    return vec3(scaled / vec2(v.projection[0][0], v.projection[1][1]), -distance);
}

// Window coordinates of a view-space position, 0 to 1 on the screen.
vec2 window_uv(View v, vec3 position) {
    vec4 clip = v.projection * vec4(position, 1.0);
    return clip.xy / clip.w * 0.5 + 0.5;
}

// Unit vector from a view-space position to the viewer.
vec3 view_space_view_dir(View v, vec3 position) {
    return v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, 1.0) : -normalize(position);
}

// The error of a distance, in metres, that corresponds to two float32 steps of window depth: a share of the distance,
// or of the depth range for orthographic views.
float depth_error(View v, float distance) {
    return 2.4e-7 * (v.projection[2][3] == 0.0 ? v.range.y - v.range.x : distance);
}

// Whether a point at `offset` from a surface lies above its tangent plane by more than the error of depth.
bool is_above_tangent_plane(View v, vec3 offset, vec3 normal, float distance) {
    return dot(offset, normal) > 0.02 * length(offset) + 2.0 * depth_error(v, distance);
}

// Whether a surface at `offset` lies in the tangent plane, with a normal that differs by less than 30°.
bool is_coplanar(vec3 offset, vec3 normal, vec3 other_normal, float tolerance) {
    return abs(dot(offset, normal)) < tolerance && dot(normal, other_normal) > 0.87;
}

// Weight of a surface at `offset` in a bilateral filter: 1 for the same plane and normal, 0 at twice the tolerance. The
// shape is close to exp(-x²), but cheaper.
float bilateral_weight(vec3 offset, vec3 normal, vec3 other_normal, float tolerance) {
    float plane_distance = 0.5 * dot(offset, normal) / tolerance;
    float near = max(1.0 - plane_distance * plane_distance, 0.0);
    float cosine = max(dot(normal, other_normal), 0.0);
    cosine *= cosine;
    float weight = near * cosine;
    weight *= weight;
    return weight * weight;
}
