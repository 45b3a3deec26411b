// The shading model that the parameter `shading` selects. Each model is an include that defines
//
//     ReflectedLight shade(Surface surface, vec3 light_dir)
//
// It returns the radiance towards the viewer for an irradiance of 1 on a surface that faces the light, so it includes
// the cosine NoL. The diffuse part is proportional to `surface.diffuse`: when light is computed per vertex, fragments
// multiply by it. A model declares what it needs beyond the common fields of `Surface`: `#pragma needs(phong)` for kd,
// ks and the exponent, `needs(grain)` for the anisotropy, `needs(grain_where_any)` for the anisotropy of the materials
// that have one, and `needs(nothing)` for a model that uses no light, only the base colour.
//
// A model may provide importance sampling, for nodes that trace paths of light. With SAMPLES_DIRECTIONS it then defines
// HAS_SAMPLED_DIRECTIONS and
//
//     vec3 sample_direction(Surface surface, vec3 xi)                 // a unit vector, from numbers from 0 to 1
//     float direction_density(Surface surface, vec3 light_dir)        // the density of this direction, in 1/sr
//
// Directions below the horizon carry no light. Others may have any density above 0; light from directions of density 0
// is lost. A model without these functions is sampled by the cosine.
#include <surface.glsl>

struct ReflectedLight {
    vec3 diffuse;
    vec3 specular;
};

#include <SHADING>
