// Sends each triangle to every layer whose view frustum it may intersect.
#include <pass_view.glsl>
layout(triangles) in;
layout(triangle_strip, max_vertices = 3 * PASS_VIEW_COUNT) out;

#ifdef ALPHA_MASK
flat in int g_material[];
flat out int v_material;
#ifdef HAS_UV0
centroid in vec2 g_uv0[];
centroid out vec2 v_uv0;
#endif
#ifdef HAS_UV1
centroid in vec2 g_uv1[];
centroid out vec2 v_uv1;
#endif
#ifdef HAS_VERTEX_COLOR
centroid in vec4 g_color[];
centroid out vec4 v_color;
#endif
#endif

// Whether all corners are beyond the same side plane of the view frustum.
bool is_outside(vec4 a, vec4 b, vec4 c) {
    vec3 w = vec3(a.w, b.w, c.w);
    vec3 x = vec3(a.x, b.x, c.x);
    vec3 y = vec3(a.y, b.y, c.y);
    return all(greaterThan(x, w)) || all(lessThan(x, -w)) || all(greaterThan(y, w)) || all(lessThan(y, -w));
}

void main() {
    for (int layer = 0; layer < PASS_VIEW_COUNT; ++layer) {
        vec4 corners[3];
        for (int i = 0; i < 3; ++i) corners[i] = pass_views[layer].view_projection * gl_in[i].gl_Position;
        if (is_outside(corners[0], corners[1], corners[2])) continue;
        for (int i = 0; i < 3; ++i) {
#ifdef ALPHA_MASK
            v_material = g_material[i];
#ifdef HAS_UV0
            v_uv0 = g_uv0[i];
#endif
#ifdef HAS_UV1
            v_uv1 = g_uv1[i];
#endif
#ifdef HAS_VERTEX_COLOR
            v_color = g_color[i];
#endif
#endif
            gl_Layer = layer;
            gl_Position = corners[i];
            EmitVertex();
        }
        EndPrimitive();
    }
}
