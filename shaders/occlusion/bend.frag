// What reduced pixels have found, or -1 where it bends too much to be put between them. What bends is told by the
// second difference along both axes, which a slope has none of; where a plane ends, as if it were mirrored there. It is
// taken over two texels, as nearer ones share what they have found; narrower planes are not told and count as bent.
#include "surfaces.glsl"
#include "value.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform float radius;    // metres
uniform float contrast;  // of openness
out Value bent;

void main() {
    View v = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    ivec2 texel = texel_here(size);
    vec4 here = look_up(surfaces, texel, size);
    vec3 position = view_position(v, place_for(texel, size, size), here.w);
    float tolerance = 0.1 * radius + depth_error(v, here.w);
    bent = look_up(source, pixel, reduced).PARTS;
    float open = openness(bent);
    vec2 rise = vec2(0.0);
    vec2 sides = vec2(0.0);
    int count = here.w > 0.0 ? 4 : 0;
    for (int i = 0; i < count; ++i) {
        ivec2 axis = ivec2(i & 1, ~i & 1);
        ivec2 there = pixel + 2 * ((i & 2) - 1) * axis;
        ivec2 inside = clamp(there, ivec2(0), reduced - 1);
        ivec2 place = surface_of(inside, size);
        vec4 seen = look_up(surfaces, place, size);
        vec3 offset = view_position(v, place_for(place, size, size), seen.w) - position;
        bool near = inside == there && in_plane(offset, here.xyz, seen.xyz, tolerance);
        vec2 counted = near ? vec2(axis) : vec2(0.0);
        rise += counted * (openness(look_up(source, inside, reduced).PARTS) - open);
        sides += counted;
    }
    vec2 bend = abs(rise) * 2.0 / max(sides, 1.0);
    bool narrow = min(sides.x, sides.y) == 0.0;
    if (narrow || max(bend.x, bend.y) > contrast) bent = Value(-1.0);
}
