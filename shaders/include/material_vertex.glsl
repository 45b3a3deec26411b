// Vertex attributes that materials need: material index, texture coordinates, vertex colour.
in ivec2 in_ids;  // material, object
flat out int v_material;
#ifdef HAS_UV0
in vec2 in_uv0;
centroid out vec2 v_uv0;
#endif
#ifdef HAS_UV1
in vec2 in_uv1;
centroid out vec2 v_uv1;
#endif
#ifdef HAS_VERTEX_COLOR
in vec4 in_color;
centroid out vec4 v_color;
#endif

// Writes `v_material`, and the texture coordinates and the vertex colour that the material reads.
void write_material_varyings() {
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
}
