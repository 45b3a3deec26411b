// Light that the rasteriser carries to the fragments. DIRECTION is `in` or `out`.
#if EVALUATE == EVALUATE_FACE
#define CARRIED flat DIRECTION
#else
#define CARRIED centroid DIRECTION
#endif

CARRIED vec3 v_diffuse;
CARRIED vec3 v_specular;
#ifdef HAS_ENVIRONMENT
CARRIED vec3 v_around_diffuse;
CARRIED vec3 v_around_specular;
#endif
#if SHADOW_LIGHT_COUNT > 0
CARRIED vec3 v_shadowed_diffuse[SHADOW_LIGHT_COUNT];
CARRIED vec3 v_shadowed_specular[SHADOW_LIGHT_COUNT];
#endif
