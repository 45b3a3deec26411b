// The two sets of texture coordinates of a fragment; (0, 0) for meshes without them.
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

// Texture coordinates of a set; BASE_COLOR_UV and similar macros are 0 or 1.
#define UV_SET(index) ((index) == 1 ? v_uv1 : v_uv0)
