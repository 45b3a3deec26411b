// Punctual lights as in KHR_lights_punctual, in the scene's order.
struct Light {
    vec4 position;   // point and spot: position and w = 1; directional: unit vector to the light and w = 0
    vec4 color;      // rgb = colour times intensity (lux or candela); w = 1 / range, 0 without a range
    vec4 direction;  // xyz = direction that it shines in; w = 0 directional, 1 point, 2 spot
    vec4 cone;       // x = s = 1 / max(0.001, cos inner - cos outer), y = -s cos outer; without a cone 0 and 1
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

// Irradiance on a surface that faces the light, in lux, at a world-space position, and the unit vector to the light in
// `light_dir`. All types of lights share one formula: properties that a type lacks have neutral values, and terms that
// no light of the scene needs are not compiled.
vec3 irradiance_from(Light light, vec3 position, out vec3 light_dir) {
    vec3 irradiance = light.color.rgb;
#if LIGHT_DIRECTIONALS == LIGHT_COUNT
    light_dir = light.position.xyz;
#else
    vec3 offset = light.position.xyz - position * light.position.w;
    float inverse_square = 1.0 / max(dot(offset, offset), 1e-12);
    light_dir = offset * sqrt(inverse_square);
    float range_ratio2 = light.color.w * light.color.w / inverse_square;  // (distance / range)²
    irradiance *= inverse_square * clamp(1.0 - range_ratio2 * range_ratio2, 0.0, 1.0);
#if LIGHT_SPOTS > 0
    float cone = clamp(light.cone.y - dot(light.direction.xyz, light_dir) * light.cone.x, 0.0, 1.0);
    irradiance *= cone * cone;
#endif
#endif
    return irradiance;
}
#endif
