// Varyings of the light that is computed per vertex or face. DIRECTION is `in` or `out`.
#if EVALUATE == EVALUATE_FACE
#define VARYING flat DIRECTION
#else
#define VARYING centroid DIRECTION
#endif

VARYING vec3 v_diffuse;
VARYING vec3 v_specular;
#ifdef HAS_ENVIRONMENT
VARYING vec3 v_environment_diffuse;
VARYING vec3 v_environment_specular;
#endif
#if SHADOW_LIGHT_COUNT > 0
VARYING vec3 v_shadowed_diffuse[SHADOW_LIGHT_COUNT];
VARYING vec3 v_shadowed_specular[SHADOW_LIGHT_COUNT];
#endif
