// A view: matrices and size that something is drawn with. Camera, shadow maps and probes all have this layout. Clip
// space has z from 0 at the far plane, or at infinity, to w at the near one: depth is reversed and a float, so that it
// is as exact far off as nearby. What a depth means is asked here; nobody compares by himself.
struct View {
    mat4 view;
    mat4 projection;
    mat4 view_projection;
    mat4 inverse_view;
    mat4 inverse_projection;
    mat4 inverse_view_projection;
    vec4 eye;       // xyz eye in world space and w = 1, or unit vector towards the viewer and w = 0 (orthographic)
    vec4 viewport;  // width, height, 1/width, 1/height in texels
    vec4 range;     // near, far in metres; the span's begin and end
    vec4 jitter;    // xy: how far the picture is moved, in widths and heights of it
};

layout(std140) uniform camera_block {
    View camera;
};

// Whether a texel of depth holds what it was cleared to: nothing is there.
bool is_nothing(float depth) {
    return depth == 0.0;
}

// Whether one depth is in front of another.
bool nearer(float depth, float other) {
    return depth > other;
}

// View-space position of a window position (0 to 1, bottom left first) and a window depth.
vec3 view_space_position(View v, vec2 uv, float depth) {
    vec4 p = v.inverse_projection * vec4(uv * 2.0 - 1.0, depth, 1.0);
    return p.xyz / p.w;
}

// The same in world space. By way of view space, where the numbers near the eye are small: float32 keeps more of them
// than through the whole inverse at once.
vec3 world_position(View v, vec2 uv, float depth) {
    return (v.inverse_view * vec4(view_space_position(v, uv, depth), 1.0)).xyz;
}

// Distance along the view axis in metres of a window position and depth, whatever the projection.
float linear_depth(View v, vec2 uv, float depth) {
    vec4 p = v.inverse_projection * vec4(uv * 2.0 - 1.0, depth, 1.0);
    return -p.z / p.w;
}

// The same of a view whose planes of equal depth are those of equal distance: a camera's, and all but warped ones.
float linear_depth(View v, float depth) {
    return (v.projection[3][2] - v.projection[3][3] * depth) / (v.projection[2][2] - v.projection[2][3] * depth);
}

// Unit vector from a world-space position to the viewer.
vec3 view_dir(View v, vec3 position) {
    return normalize(v.eye.xyz - position * v.eye.w);
}
