// A view: the matrices and the size that a pass renders with. The camera, shadow maps and probes share this layout.
// Depth is reversed: clip space has z from 0 at the far plane or at infinity to w at the near plane, and depth is a
// float, so that precision is even over distance. Shaders use the functions below and do not compare depths themselves.
struct View {
    mat4 view;
    mat4 projection;
    mat4 view_projection;
    mat4 inverse_view;
    mat4 inverse_projection;
    mat4 inverse_view_projection;
    vec4 eye;       // eye in world space and w = 1; orthographic: unit vector to the viewer and w = 0
    vec4 viewport;  // width, height, 1/width, 1/height in texels
    vec4 range;     // near, far in metres; begin and end of the span
    vec4 jitter;    // xy = offset of the picture, in widths and heights of it
};

layout(std140) uniform camera_block {
    View camera;
};

// Whether a depth is the clear value, so that the texel shows the background.
bool is_nothing(float depth) {
    return depth == 0.0;
}

// Whether a depth is in front of an `other` one.
bool nearer(float depth, float other) {
    return depth > other;
}

// View-space position, in metres, of a window position and depth.
vec3 view_space_position(View v, vec2 uv, float depth) {
    vec4 p = v.inverse_projection * vec4(uv * 2.0 - 1.0, depth, 1.0);
    return p.xyz / p.w;
}

// World-space position, in metres, of a window position and depth. The computation goes through view space, where
// numbers near the eye are small, so that float32 loses less than with the combined inverse matrix.
vec3 world_position(View v, vec2 uv, float depth) {
    return (v.inverse_view * vec4(view_space_position(v, uv, depth), 1.0)).xyz;
}

// Distance along the view axis in metres of a window position and depth, for any projection.
float linear_depth(View v, vec2 uv, float depth) {
    vec4 p = v.inverse_projection * vec4(uv * 2.0 - 1.0, depth, 1.0);
    return -p.z / p.w;
}

// The same from the depth alone, for views without warp: equal depth means equal distance along the view axis.
float linear_depth(View v, float depth) {
    return (v.projection[3][2] - v.projection[3][3] * depth) / (v.projection[2][2] - v.projection[2][3] * depth);
}

// Unit vector from a world-space position to the viewer.
vec3 view_dir(View v, vec3 position) {
    return normalize(v.eye.xyz - position * v.eye.w);
}
