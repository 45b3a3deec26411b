// Rotation and intensity of the scene's environment map.
#include <math.glsl>

layout(std140) uniform environment_block {
    vec4 environment_transform;   // cosine and sine of the rotation about +Y, intensity, 0
    vec4 environment_projection;  // where shadow catchers project the map from; distance where they stop, or 0
};

// Rotates a world-space direction into the space of the environment map.
vec3 world_to_environment(vec3 direction) {
    vec2 r = environment_transform.xy;
    return vec3(r.x * direction.x - r.y * direction.z, direction.y, r.y * direction.x + r.x * direction.z);
}
