// Varyings between the vertex and the geometry shader, which hands them on under their own names.
#define v_material g_material
#define v_uv0 g_uv0
#define v_uv1 g_uv1
#define v_color g_color
