// A view: matrices and size that something is drawn with. Camera, shadow maps and probes all have this layout.
struct View {
    mat4 view;
    mat4 projection;
    mat4 view_projection;
    mat4 inverse_view;
    mat4 inverse_projection;
    mat4 inverse_view_projection;
    vec4 eye;       // xyz eye in world space and w = 1, or unit vector towards the viewer and w = 0 (orthographic)
    vec4 viewport;  // width, height, 1/width, 1/height in texels
    vec4 range;     // near, far in metres, 0, 0
};

layout(std140) uniform camera_block {
    View camera;
};

// World-space position of a window position (0 to 1, bottom left first) and a window depth. By way of view space, where
// the numbers near the eye are small: float32 keeps more of them than through the whole inverse at once.
vec3 world_position(View v, vec2 uv, float depth) {
    vec4 p = v.inverse_projection * vec4(vec3(uv, depth) * 2.0 - 1.0, 1.0);
    return (v.inverse_view * vec4(p.xyz / p.w, 1.0)).xyz;
}

// Distance along the view axis in metres of a window depth.
float linear_depth(View v, float depth) {
    float z = depth * 2.0 - 1.0;
    return (v.projection[3][2] - v.projection[3][3] * z) / (v.projection[2][2] - v.projection[2][3] * z);
}

// Unit vector from a world-space position to the viewer.
vec3 to_viewer(View v, vec3 position) {
    return normalize(v.eye.xyz - position * v.eye.w);
}
