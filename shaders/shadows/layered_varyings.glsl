// Names of the varyings between vertex and geometry shader. The geometry shader passes them on under the usual names.
#define v_material g_material
#define v_uv0 g_uv0
#define v_uv1 g_uv1
#define v_color g_color
