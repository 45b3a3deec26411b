// Punctual lights as KHR_lights_punctual has them, in the scene's order.
struct Light {
    vec4 position;   // directional: unit vector to the light, w = 0; else its position, w = 1
    vec4 color;      // rgb = colour times intensity (lux or candela); w = 1 / range, 0 without a range
    vec4 direction;  // xyz = the axis it shines along; w = 0 directional, 1 point, 2 spot
    vec4 cone;       // x = s = 1 / max(0.001, cos inner - cos outer), y = -s cos outer; 0 and 1 where there is no cone
};

#if LIGHT_COUNT > 0
#ifdef LIGHT_STORAGE
layout(std430) readonly buffer light_block {
    Light lights[];
};
#else
layout(std140) uniform light_block {
    Light lights[LIGHT_COUNT];
};
#endif

// Irradiance on a surface that faces the light, and the unit vector to it. One formula for all kinds: what a kind lacks
// has a neutral value, and is not compiled where the scene has no light that needs it.
vec3 irradiance_from(Light light, vec3 position, out vec3 to_light) {
    vec3 irradiance = light.color.rgb;
#if LIGHT_DIRECTIONALS == LIGHT_COUNT
    to_light = light.position.xyz;
#else
    vec3 towards = light.position.xyz - position * light.position.w;
    float inverse_square = 1.0 / max(dot(towards, towards), 1e-12);
    to_light = towards * sqrt(inverse_square);
    float reach = light.color.w * light.color.w / inverse_square;  // (distance / range) squared
    irradiance *= inverse_square * clamp(1.0 - reach * reach, 0.0, 1.0);
#if LIGHT_SPOTS > 0
    float cone = clamp(light.cone.y - dot(light.direction.xyz, to_light) * light.cone.x, 0.0, 1.0);
    irradiance *= cone * cone;
#endif
#endif
    return irradiance;
}
#endif
