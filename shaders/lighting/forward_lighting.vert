// Forward lighting, evaluated per vertex.
#include <geometry_vertex.glsl>
#include "vertex_light.glsl"
#define DIRECTION out
#include "vertex_light_varyings.glsl"

void main() {
    transform_vertex();
    VertexLight light = vertex_light(v_material, v_position, normalize(v_normal));
    v_diffuse = light.unshadowed.diffuse;
    v_specular = light.unshadowed.specular;
#ifdef HAS_ENVIRONMENT
    v_environment_diffuse = light.environment.diffuse;
    v_environment_specular = light.environment.specular;
#endif
#if SHADOW_LIGHT_COUNT > 0
    for (int k = 0; k < SHADOW_LIGHT_COUNT; ++k) {
        v_shadowed_diffuse[k] = light.shadowed[k].diffuse;
        v_shadowed_specular[k] = light.shadowed[k].specular;
    }
#endif
}
