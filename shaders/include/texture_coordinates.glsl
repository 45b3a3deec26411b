// The two sets of texture coordinates of a fragment; a mesh without them has (0, 0) everywhere.
#ifdef HAS_UV0
centroid in vec2 v_uv0;
#else
const vec2 v_uv0 = vec2(0.0);
#endif
#ifdef HAS_UV1
centroid in vec2 v_uv1;
#else
const vec2 v_uv1 = vec2(0.0);
#endif

// A slot's set: BASE_COLOR_UV and its like are 0 or 1.
#define UV_SET(number) ((number) == 1 ? v_uv1 : v_uv0)
