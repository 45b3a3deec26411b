// Positions and geometric normals from a depth texture, by way of the view it was drawn with: of one sample of a texel,
// by its number, or in the middle of all.
#if DEPTH_SAMPLES > 1
uniform sampler2DMS depth;
const int TEXEL_CENTER = -1;
#define SAMPLE_POSITION(number) DEPTH_SAMPLE_POSITIONS[number]
#else
uniform sampler2D depth;
const int TEXEL_CENTER = 0;
#define SAMPLE_POSITION(number) vec2(0.5)
#endif

vec3 position_from_depth(ivec2 texel, vec2 place, float d) {
    return world_position(depth_views[0], (vec2(texel) + place) * depth_views[0].viewport.zw, d);
}

vec3 position_at_sample(ivec2 texel, int number, out float d) {
    d = texelFetch(depth, texel, number).r;
    return position_from_depth(texel, SAMPLE_POSITION(number), d);
}

vec3 position_at(ivec2 texel, int number, out float d) {
#if DEPTH_SAMPLES > 1
    if (number == TEXEL_CENTER) {  // of a plane the mean of depths is the depth at the mean of places: the middle
        d = 0.0;
        for (int i = 0; i < DEPTH_SAMPLES; ++i) d += texelFetch(depth, texel, i).r / float(DEPTH_SAMPLES);
        return position_from_depth(texel, vec2(0.5), d);
    }
#endif
    return position_at_sample(texel, number, d);
}

// The step from the point to its neighbours along one axis, on the side where depth is closer to a straight line.
vec3 along(ivec2 texel, int number, ivec2 axis, vec3 here, float d) {
    ivec2 last = ivec2(depth_views[0].viewport.xy) - 1;
    float before = texelFetch(depth, max(texel - axis, ivec2(0)), number).r;
    float after = texelFetch(depth, min(texel + axis, last), number).r;
    float before2 = texelFetch(depth, max(texel - 2 * axis, ivec2(0)), number).r;
    float after2 = texelFetch(depth, min(texel + 2 * axis, last), number).r;
    bool at_left = any(lessThan(texel - axis, ivec2(0)));
    bool at_right = any(greaterThan(texel + axis, last));
    bool use_left = !at_left && (at_right || abs(2.0 * before - before2 - d) < abs(2.0 * after - after2 - d));
    ivec2 beside = clamp(use_left ? texel - axis : texel + axis, ivec2(0), last);
    vec3 there = position_from_depth(beside, SAMPLE_POSITION(number), use_left ? before : after);
    return use_left ? here - there : there - here;
}

// Unit normal of the surface at a texel, towards the viewer: of each pair of neighbours the one on the same surface.
vec3 geometric_normal_at(ivec2 texel, int number, vec3 position, float d) {
    if (number == TEXEL_CENTER) position = position_at_sample(texel, number = 0, d);
    vec3 crossed =
        cross(along(texel, number, ivec2(1, 0), position, d), along(texel, number, ivec2(0, 1), position, d));
    return crossed * inversesqrt(max(dot(crossed, crossed), 1e-37));
}
