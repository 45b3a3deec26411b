// Cube maps: directions and solid angles of texels. A position on a face runs from -1 to 1 along both sides.

// Unit direction of a position on a face; the faces are in OpenGL's order.
vec3 cube_direction(int face, vec2 position) {
    vec3 direction;
    if (face == 0) direction = vec3(1.0, -position.y, -position.x);
    else if (face == 1) direction = vec3(-1.0, -position.y, position.x);
    else if (face == 2) direction = vec3(position.x, 1.0, position.y);
    else if (face == 3) direction = vec3(position.x, -1.0, -position.y);
    else if (face == 4) direction = vec3(position.x, -position.y, 1.0);
    else direction = vec3(-position.x, -position.y, -1.0);
    return normalize(direction);
}

// Position of the centre of a texel on a face of `size` × `size` texels.
vec2 cube_texel_center(ivec2 texel, int size) {
    return (vec2(texel) + 0.5) * (2.0 / float(size)) - 1.0;
}

// Solid angle in steradians of a texel that is centred at a position, on a face of `size` × `size` texels.
float cube_solid_angle(vec2 position, int size) {
    float squared_distance = 1.0 + dot(position, position);
    return 4.0 / (float(size * size) * squared_distance * sqrt(squared_distance));
}
