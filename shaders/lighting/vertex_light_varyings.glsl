// Light that the rasteriser carries to the fragments. DIRECTION is `in` or `out`.
#if EVALUATE == EVALUATE_FACE
#define CARRIED flat DIRECTION
#else
#define CARRIED DIRECTION
#endif

CARRIED vec3 v_diffuse;
CARRIED vec3 v_specular;
#if SHADOW_LIGHT_COUNT > 0
CARRIED vec3 v_shadowed_diffuse[SHADOW_LIGHT_COUNT];
CARRIED vec3 v_shadowed_specular[SHADOW_LIGHT_COUNT];
#endif
