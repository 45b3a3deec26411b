// Positions and geometric normals from a depth texture, by way of the view it was drawn with.
uniform sampler2D depth;

vec3 position_at(ivec2 texel, out float d) {
    d = texelFetch(depth, texel, 0).r;
    return world_position(depth_views[0], (vec2(texel) + 0.5) * depth_views[0].viewport.zw, d);
}

// The step from the point to its neighbours along one axis, on the side where depth is closer to a straight line.
vec3 along(ivec2 texel, ivec2 axis, vec3 here, float d) {
    ivec2 last = textureSize(depth, 0) - 1;
    float before, after, before2, after2;
    vec3 left = position_at(max(texel - axis, ivec2(0)), before);
    vec3 right = position_at(min(texel + axis, last), after);
    before2 = texelFetch(depth, max(texel - 2 * axis, ivec2(0)), 0).r;
    after2 = texelFetch(depth, min(texel + 2 * axis, last), 0).r;
    bool at_left = any(lessThan(texel - axis, ivec2(0)));
    bool at_right = any(greaterThan(texel + axis, last));
    bool use_left = !at_left && (at_right || abs(2.0 * before - before2 - d) < abs(2.0 * after - after2 - d));
    return use_left ? here - left : right - here;
}

// Unit normal of the surface at a texel, towards the viewer: of each pair of neighbours the one on the same surface.
vec3 geometric_normal_at(ivec2 texel, vec3 position, float d) {
    vec3 crossed = cross(along(texel, ivec2(1, 0), position, d), along(texel, ivec2(0, 1), position, d));
    return crossed * inversesqrt(max(dot(crossed, crossed), 1e-37));
}
