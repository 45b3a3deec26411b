// What is around the scene: how its picture is turned, and where in it a direction lies.
#include <math.glsl>

layout(std140) uniform environment_block {
    vec4 environment_transform;  // cosine and sine of the angle about +Y, a factor on its radiance, 0
};

// A direction of the world as the picture has it.
vec3 world_to_environment(vec3 direction) {
    vec2 turn = environment_transform.xy;
    return vec3(turn.x * direction.x - turn.y * direction.z, direction.y, turn.y * direction.x + turn.x * direction.z);
}
