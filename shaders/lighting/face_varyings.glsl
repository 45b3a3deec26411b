// Names of the varyings between vertex and geometry shader. The geometry shader passes them on under the usual names.
#define v_position g_position
#define v_centroid_position g_centroid_position
#define v_normal g_normal
#define v_material g_material
#define v_object g_object
#define v_uv0 g_uv0
#define v_uv1 g_uv1
#define v_tangent g_tangent
#define v_color g_color
