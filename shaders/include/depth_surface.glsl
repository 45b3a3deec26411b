// Reconstructs positions and geometric normals from a depth texture, with the view that it was rendered with. A sample
// index of TEXEL_CENTER means the centre of a texel, averaged over all samples.
#if DEPTH_SAMPLES > 1
uniform sampler2DMS depth;
const int TEXEL_CENTER = -1;
#define SAMPLE_POSITION(index) DEPTH_SAMPLE_POSITIONS[max(index, 0)]  // drivers refuse a constant TEXEL_CENTER
#else
uniform sampler2D depth;
const int TEXEL_CENTER = 0;
#define SAMPLE_POSITION(index) vec2(0.5)
#endif

// World-space position at an offset (0 to 1) within a texel.
vec3 position_from_depth(ivec2 texel, vec2 offset, float window_depth) {
    return world_position(depth_views[0], (vec2(texel) + offset) * depth_views[0].viewport.zw, window_depth);
}

// World-space position of one sample of a texel, and its window depth.
vec3 position_at_sample(ivec2 texel, int sample_index, out float window_depth) {
    window_depth = texelFetch(depth, texel, sample_index).r;
    return position_from_depth(texel, SAMPLE_POSITION(sample_index), window_depth);
}

// World-space position of a sample, or of the centre of a texel with TEXEL_CENTER, and its window depth.
vec3 position_at(ivec2 texel, int sample_index, out float window_depth) {
#if DEPTH_SAMPLES > 1
    if (sample_index == TEXEL_CENTER) {
        // On a plane the mean depth of the samples is the depth at their mean position, the texel's centre.
        window_depth = 0.0;
        for (int i = 0; i < DEPTH_SAMPLES; ++i) window_depth += texelFetch(depth, texel, i).r / float(DEPTH_SAMPLES);
        return position_from_depth(texel, vec2(0.5), window_depth);
    }
#endif
    return position_at_sample(texel, sample_index, window_depth);
}

// Difference of world positions between neighbouring texels along a screen axis, (1, 0) or (0, 1), in metres per texel.
// It is taken towards the neighbour on the side where depth is closer to linear, which is the side that lies on the
// same surface. `position` is the texel's own.
vec3 screen_derivative(ivec2 texel, int sample_index, ivec2 axis, vec3 position, float window_depth) {
    ivec2 last = ivec2(depth_views[0].viewport.xy) - 1;
    float left = texelFetch(depth, max(texel - axis, ivec2(0)), sample_index).r;
    float right = texelFetch(depth, min(texel + axis, last), sample_index).r;
    float left2 = texelFetch(depth, max(texel - 2 * axis, ivec2(0)), sample_index).r;
    float right2 = texelFetch(depth, min(texel + 2 * axis, last), sample_index).r;
    bool at_left_border = any(lessThan(texel - axis, ivec2(0)));
    bool at_right_border = any(greaterThan(texel + axis, last));
    float left_error = abs(2.0 * left - left2 - window_depth), right_error = abs(2.0 * right - right2 - window_depth);
    bool use_left = !at_left_border && (at_right_border || left_error < right_error);
    ivec2 neighbour = clamp(use_left ? texel - axis : texel + axis, ivec2(0), last);
    vec3 other = position_from_depth(neighbour, SAMPLE_POSITION(sample_index), use_left ? left : right);
    return use_left ? position - other : other - position;
}

// Unit geometric normal of the surface at a texel, in world space, facing the viewer. `position` and `window_depth` are
// those of the texel.
vec3 geometric_normal_at(ivec2 texel, int sample_index, vec3 position, float window_depth) {
    if (sample_index == TEXEL_CENTER) position = position_at_sample(texel, sample_index = 0, window_depth);
    vec3 dx = screen_derivative(texel, sample_index, ivec2(1, 0), position, window_depth);
    vec3 dy = screen_derivative(texel, sample_index, ivec2(0, 1), position, window_depth);
    vec3 normal = cross(dx, dy);
    return normal * inversesqrt(max(dot(normal, normal), 1e-37));
}

// The height of a pixel, in metres, at `view_distance` metres from the viewer along the view axis.
float pixel_height(float view_distance) {
    float projected = depth_views[0].projection[2][3] == 0.0 ? 1.0 : abs(view_distance);
    return 2.0 * projected / (depth_views[0].projection[1][1] * depth_views[0].viewport.y);
}

// The largest distance, in metres, of a position from depth above or below its surface, at `view_distance` metres from
// the viewer. Rasterisers snap vertices to 1/256 of a pixel, which moves the surface by the same fraction of a pixel's
// height. This matters in pictures with few pixels.
float snapped_by(float view_distance) {
    return pixel_height(view_distance) / 256.0;
}
