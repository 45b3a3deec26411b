// A distinct sRGB-encoded colour for each layer of a shadow map.
vec3 layer_color(int layer) {
    const vec3 colors[8] = vec3[](
        vec3(0.90, 0.25, 0.20), vec3(0.25, 0.75, 0.30), vec3(0.25, 0.45, 0.95), vec3(0.95, 0.80, 0.20),
        vec3(0.80, 0.30, 0.85), vec3(0.20, 0.80, 0.85), vec3(0.95, 0.55, 0.15), vec3(0.60, 0.60, 0.65));
    return colors[layer % 8];
}
