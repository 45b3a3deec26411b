// The shading models, one include each with one signature:
//
//     ReflectedLight shade(Surface surface, vec3 to_light)
//
// Radiance towards the viewer for an irradiance of 1 on a surface that faces the light: the cosine is in it. The
// diffuse part is proportional to `surface.diffuse`; light computed at vertices leaves that factor to the fragments.
// What a model looks at and others do not it says once: `#pragma needs(phong)` for kd, ks and the exponent,
// `needs(grain)` for the grain, `needs(grain_where_any)` for that of materials that have one, `needs(nothing)` where no
// light shows and the base colour alone is looked at.
#include <surface.glsl>

struct ReflectedLight {
    vec3 diffuse;
    vec3 specular;
};

#include <SHADING>
