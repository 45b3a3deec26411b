// One light's visibility in screen space: `shadow()` at the positions that the depth texture holds.
// The geometric normal comes from the neighbours in depth, of each pair the one that lies on the same surface.
uniform sampler2D depth;
out vec4 visibility;

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

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float d;
    vec3 position = position_at(texel, d);
    visibility = vec4(1.0);
    if (d == 1.0) return;  // nothing is there
    vec3 crossed = cross(along(texel, ivec2(1, 0), position, d), along(texel, ivec2(0, 1), position, d));
    vec3 normal = crossed * inversesqrt(max(dot(crossed, crossed), 1e-37));
    visibility = vec4(shadow(LIGHT, position, normal));
}
