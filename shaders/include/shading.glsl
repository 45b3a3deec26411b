// The shading models, one include each with one signature:
//
//     Reflected reflected(Surface surface, vec3 to_light)
//
// Radiance towards the viewer for an irradiance of 1 on a surface that faces the light: the cosine is in it.
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
#else
#include <shading/unlit.glsl>
#endif
