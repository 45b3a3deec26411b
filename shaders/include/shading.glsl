// The shading models, one include each with one signature:
//
//     Reflected reflected(Surface surface, vec3 to_light)
//
// Radiance towards the viewer for an irradiance of 1 on a surface that faces the light: the cosine is in it. The
// diffuse part is proportional to `surface.diffuse`; light computed at vertices leaves that factor to the fragments.
#include <surface.glsl>

struct Reflected {
    vec3 diffuse;
    vec3 specular;
};

#if SHADING == SHADING_PBR
#include <shading/pbr.glsl>
#elif SHADING == SHADING_ANISOTROPIC
#include <shading/anisotropic.glsl>
#elif SHADING == SHADING_BLINN_PHONG
#include <shading/blinn_phong.glsl>
#elif SHADING == SHADING_PHONG
#include <shading/phong.glsl>
#elif SHADING == SHADING_UNLIT
#include <shading/unlit.glsl>
#else
#include <SHADING>
#endif
