// Cube maps: the direction of a texel, and how much of the sphere it covers.

// Unit direction of a point of a face, whose sides run from -1 to 1, in the order of OpenGL's faces.
vec3 cube_direction(int face, vec2 place) {
    vec3 direction;
    if (face == 0) direction = vec3(1.0, -place.y, -place.x);
    else if (face == 1) direction = vec3(-1.0, -place.y, place.x);
    else if (face == 2) direction = vec3(place.x, 1.0, place.y);
    else if (face == 3) direction = vec3(place.x, -1.0, -place.y);
    else if (face == 4) direction = vec3(place.x, -place.y, 1.0);
    else direction = vec3(-place.x, -place.y, -1.0);
    return normalize(direction);
}

// The middle of a texel of a face of `side` texels, from -1 to 1.
vec2 cube_texel_center(ivec2 texel, int side) {
    return (vec2(texel) + 0.5) * (2.0 / float(side)) - 1.0;
}

// Steradians of a texel around a place.
float cube_solid_angle(vec2 place, int side) {
    float square = 1.0 + dot(place, place);
    return 4.0 / (float(side * side) * square * sqrt(square));
}
