// The mean of what the 4×4 pixels around have found, for a picture that is interpolated or filtered further: its middle
// is the pixel, so that a slope stays one, where `neighbours_mean.frag` makes stairs of it. Two by two pixels hold what they share: of
// nine such quads the middle one counts half along each axis, the nearer neighbour three eighths, the farther one the
// rest. All four pixels of a quad need the same nine, so each looks three up and has the others from them.
#include "surfaces.glsl"
#include "finish.glsl"
#include "lanes.glsl"
uniform sampler2D unfiltered;
uniform sampler2D surfaces;
uniform ivec2 screen;
uniform float radius;  // metres

Seen seen_at(View v, ivec2 pixel, ivec2 size) {
    ivec2 target = target_size(size);
    ivec2 inside = clamp(pixel, ivec2(0), target - 1);
    ivec2 texel = surface_of(inside, size);
    vec4 surface = look_up(surfaces, texel, size);
    vec3 normal = inside == pixel ? surface.xyz : vec3(0.0);
    return Seen(view_position(v, place_for(texel, size, screen), surface.w), normal,
                look_up(unfiltered, inside, target).PARTS);
}

void add(inout Value sum, inout float total, Seen here, Seen there, float share, float tolerance) {
    float weight = share * same_surface(there.position - here.position, here.normal, there.normal, tolerance);
    sum += weight * there.value;
    total += weight;
}

void main() {
    View v = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    vec2 other = vec2(1 - 2 * (pixel & 1));
    ivec2 side = -2 * ivec2(other);
    Seen here = seen_at(v, pixel, size);
    Seen across = seen_at(v, pixel + ivec2(side.x, 0), size);
    Seen along = seen_at(v, pixel + ivec2(0, side.y), size);
    Seen aslant = seen_at(v, pixel + side, size);
    Seen opposite = from_y(aslant, other.y);
    float tolerance = 0.1 * radius + depth_error(v, -here.position.z);
    float total = 0.25;
    Value sum = total * here.value;
    add(sum, total, here, across, 0.1875, tolerance);
    add(sum, total, here, from_x(across, other.x), 0.0625, tolerance);
    add(sum, total, here, along, 0.1875, tolerance);
    add(sum, total, here, from_y(along, other.y), 0.0625, tolerance);
    add(sum, total, here, aslant, 0.140625, tolerance);
    add(sum, total, here, from_x(aslant, other.x), 0.046875, tolerance);
    add(sum, total, here, opposite, 0.046875, tolerance);
    add(sum, total, here, from_x(opposite, other.x), 0.015625, tolerance);
    finish(here.position.z < 0.0 ? sum / total : NOTHING);
}
