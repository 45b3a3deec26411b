// What stands for the scene in image space: at each texel a unit normal in view space and in w the distance along the
// view axis in metres, 0 where nothing is. The picture may be smaller than the screen; each of its texels then holds
// the surface of one of the screen's, not a mean of several.

// The texel of a picture of size `screen` that a texel of a picture of size `small` stands for. Numbers with a point
// are divided: whole ones some processors can only divide one by one.
ivec2 stands_for(ivec2 texel, ivec2 small, ivec2 screen) {
    vec2 step = vec2(screen) / vec2(small);
    return ivec2((vec2(texel) + 0.5) * step + 0.25 / vec2(small));
}

// The same where `surfaces` are of the smaller size; without REDUCED they are the screen's.
ivec2 texel_for(ivec2 texel, ivec2 small, ivec2 screen) {
#ifdef REDUCED
    return stands_for(texel, small, screen);
#else
    return texel;
#endif
}

#ifdef SPARSE
uniform ivec2 reduced;  // size of the target, where its pixels are about some of a larger picture's surfaces
#endif

// How many pixels the target has, where `surfaces` have `size`.
ivec2 target_size(ivec2 size) {
#ifdef SPARSE
    return reduced;
#else
    return size;
#endif
}

// The texel of `surfaces` that a pixel of the target is about.
ivec2 surface_of(ivec2 pixel, ivec2 size) {
#ifdef SPARSE
    return stands_for(pixel, reduced, size);
#else
    return pixel;
#endif
}

// The same of this pixel.
ivec2 texel_here(ivec2 size) {
    return surface_of(ivec2(gl_FragCoord.xy), size);
}

// The middle of that texel, 0 to 1.
vec2 place_for(ivec2 texel, ivec2 small, ivec2 screen) {
    return (vec2(texel_for(texel, small, screen)) + 0.5) / vec2(screen);
}

// A texel of a picture of a size, by its middle: a sampler knows that there is one mip level, where `texelFetch` asks
// for it at each pixel, which on a software rasteriser is half of its work.
vec4 look_up(sampler2D picture, ivec2 texel, ivec2 size) {
    return textureLod(picture, (vec2(texel) + 0.5) / vec2(size), 0.0);
}

// Clip space's w at a distance along the view axis: the distance itself, or 1 where the view is orthographic.
float clip_w(View v, float distance) {
    return v.projection[3][3] - v.projection[2][3] * distance;
}

// View-space position at a place of the window (0 to 1) and a distance along the view axis.
vec3 view_position(View v, vec2 place, float distance) {
    vec2 ndc = place * 2.0 - 1.0;
    vec2 moved = ndc * clip_w(v, distance) + v.projection[2].xy * distance - v.projection[3].xy;
    return vec3(moved / vec2(v.projection[0][0], v.projection[1][1]), -distance);
}

// Where a view-space position lies in the window, 0 to 1 inside.
vec2 window_place(View v, vec3 position) {
    vec4 clip = v.projection * vec4(position, 1.0);
    return clip.xy / clip.w * 0.5 + 0.5;
}

// Unit vector from a view-space position towards the eye.
vec3 to_eye(View v, vec3 position) {
    return v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, 1.0) : -normalize(position);
}

// Two float32 steps of window depth as metres along the view axis: a share of the distance, or of the range where the
// view is orthographic.
float depth_error(View v, float distance) {
    return 2.4e-7 * (v.projection[2][3] == 0.0 ? v.range.y - v.range.x : distance);
}

// Whether a point at `offset` from a surface stands out from its tangent plane, by more than depth can be wrong.
bool rises(View v, vec3 offset, vec3 normal, float distance) {
    return dot(offset, normal) > 0.02 * length(offset) + 2.0 * depth_error(v, distance);
}

// Whether a neighbour at `offset` lies in the same plane and faces the same way, to within 30°.
bool in_plane(vec3 offset, vec3 normal, vec3 neighbour, float tolerance) {
    return abs(dot(offset, normal)) < tolerance && dot(normal, neighbour) > 0.87;
}

// 1 where a neighbour at `offset` lies in the same plane and faces the same way, 0 where it is another surface: at
// twice the tolerance, nearly as exp(-x²) falls, without its cost.
float same_surface(vec3 offset, vec3 normal, vec3 neighbour, float tolerance) {
    float off_plane = 0.5 * dot(offset, normal) / tolerance;
    float near = max(1.0 - off_plane * off_plane, 0.0);
    float facing = max(dot(normal, neighbour), 0.0);
    facing *= facing;
    float alike = near * facing;
    alike *= alike;
    return alike * alike;
}
