// Shadows from a depth cube map (P. Gerasimov, "Omnidirectional Shadow Mapping", GPU Gems, 2004), looked up by
// direction: the sampler selects the face, and filters across faces at their edges.
uniform float bias;           // texels towards the light
uniform float normal_offset;  // scale of the normal offset

#ifdef HAS_CUBE
uniform samplerCubeShadow cube;

// Window depth in the face that a direction lies in: all faces have the same projection, along their own axes.
float face_depth(vec3 light_to_point) {
    vec3 magnitude = abs(light_to_point);
    float distance = max(magnitude.x, max(magnitude.y, magnitude.z));
    mat4 projection = cube_views[0].projection;
    return (projection[3][2] - projection[2][2] * distance) / distance;
}

float shadow(int light, vec3 position, vec3 normal) {
    if (light != cube_lights[0]) return 1.0;
    vec3 light_to_point = position - cube_views[0].eye.xyz;
    vec3 m = abs(light_to_point);
    vec3 axis = m.x >= max(m.y, m.z) ? vec3(1.0, 0.0, 0.0) : m.y >= m.z ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    vec3 face_x = axis.yzx, face_y = axis.zxy;
    float texel = 2.0 * dot(axis, m) * cube_views[0].viewport.z;  // metres, at constant depth of the face
    // The offset of map_shadow.glsl: above the part of the receiver's plane that the kernel covers, plus the bias.
    float slope = texel * (abs(dot(face_x, normal)) + abs(dot(face_y, normal)));
    light_to_point += normal * (normal_offset * (0.5 * float(TAPS) + 0.5) * slope)
        - normalize(light_to_point) * (bias * texel);

    float lit = 0.0;
    for (int y = 0; y < TAPS; ++y) {
        for (int x = 0; x < TAPS; ++x) {
            vec2 offset = (vec2(x, y) - 0.5 * float(TAPS - 1)) * texel;
            vec3 direction = light_to_point + face_x * offset.x + face_y * offset.y;
            lit += texture(cube, vec4(direction, face_depth(direction)));
        }
    }
    return lit / float(TAPS * TAPS);
}
#else
float shadow(int light, vec3 position, vec3 normal) {
    return 1.0;
}
#endif
