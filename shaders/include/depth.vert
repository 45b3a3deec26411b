// Positions alone, and what an alpha mask needs where there is one.
#include <transform.glsl>

#ifdef ALPHA_MASK
in ivec2 in_ids;
flat out int v_material;
#ifdef HAS_UV0
in vec2 in_uv0;
out vec2 v_uv0;
#endif
#ifdef HAS_UV1
in vec2 in_uv1;
out vec2 v_uv1;
#endif
#ifdef HAS_VERTEX_COLOR
in vec4 in_color;
out vec4 v_color;
#endif
#endif

void main() {
#ifdef ALPHA_MASK
    v_material = in_ids.x;
#ifdef HAS_UV0
    v_uv0 = in_uv0;
#endif
#ifdef HAS_UV1
    v_uv1 = in_uv1;
#endif
#ifdef HAS_VERTEX_COLOR
    v_color = in_color;
#endif
#endif
    gl_Position = world_to_clip(object_to_world(in_position));
}
