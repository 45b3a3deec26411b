// Shadows from a cube map of depth (P. Gerasimov, "Omnidirectional Shadow Mapping", GPU Gems, 2004), looked up by
// direction: the sampler finds the face, and weighs texels of two or three faces at their edges.
uniform float bias;           // texels towards the light
uniform float normal_offset;  // factor on what the slope asks for

#ifdef HAS_CUBE
uniform samplerCubeShadow cube;

// Window depth in the face that a direction lies in: all faces have one projection, along their own axes.
float face_depth(vec3 from_light) {
    vec3 sides = abs(from_light);
    float distance = max(sides.x, max(sides.y, sides.z));
    mat4 projection = cube_views[0].projection;
    return (projection[3][2] - projection[2][2] * distance) / distance;
}

float shadow(int light, vec3 position, vec3 normal) {
    if (light != cube_lights[0]) return 1.0;
    vec3 from_light = position - cube_views[0].eye.xyz;
    vec3 sides = abs(from_light);
    vec3 axis = sides.x >= max(sides.y, sides.z) ? vec3(1.0, 0.0, 0.0) : sides.y >= sides.z ? vec3(0.0, 1.0, 0.0)
                                                                                            : vec3(0.0, 0.0, 1.0);
    vec3 right = axis.yzx, up = axis.zxy;
    float texel = 2.0 * dot(axis, sides) * cube_views[0].viewport.z;  // metres, at an unchanged depth of the face
    // As in map_shadow.glsl: above all of its own plane that the kernel meets, and a little towards the light.
    float lean = texel * (abs(dot(right, normal)) + abs(dot(up, normal)));
    from_light += normal * (normal_offset * (0.5 * float(TAPS) + 0.5) * lean) - normalize(from_light) * (bias * texel);

    float lit = 0.0;
    for (int y = 0; y < TAPS; ++y) {
        for (int x = 0; x < TAPS; ++x) {
            vec2 apart = (vec2(x, y) - 0.5 * float(TAPS - 1)) * texel;
            vec3 there = from_light + right * apart.x + up * apart.y;
            lit += texture(cube, vec4(there, face_depth(there)));
        }
    }
    return lit / float(TAPS * TAPS);
}
#else
float shadow(int light, vec3 position, vec3 normal) {
    return 1.0;
}
#endif
