// One triangle that covers the render target, at the far plane.
out vec2 v_uv;  // 0 to 1 over the target, from the bottom left

void main() {
    v_uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(v_uv * 2.0 - 1.0, 0.0, 1.0);
}
