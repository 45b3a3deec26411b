// A smaller picture at full size where that is as good as computing it: where some of the four around a pixel lie on
// its own surface, and none of them bends. All others are marked in the depth, as by `refine.frag`.
#include "surfaces.glsl"
#include "finish.glsl"
#include "lanes.glsl"
uniform sampler2D source;  // smaller; openness below 0 where it bends
uniform sampler2D surfaces;
uniform float radius;      // metres
out Value found;           // the same, for the passes that filter what is marked

// What lies around a pixel on its own surface.
struct Around {
    Value sum;
    float total;
    bool bends;
};

void add(inout Around around, vec3 position, vec3 normal, Seen seen, float share, float tolerance) {
    float weight = in_plane(seen.position - position, normal, seen.normal, tolerance) ? share : 0.0;
    around.sum += weight * seen.value;
    around.total += weight;
    around.bends = around.bends || weight > 0.0 && openness(seen.value) < -0.5;
}

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 screen = textureSize(surfaces, 0);
    ivec2 size = textureSize(source, 0);
    vec4 here = texelFetch(surfaces, texel, 0);
    vec3 position = view_position(v, (vec2(texel) + 0.5) / vec2(screen), here.w);
    float tolerance = 0.1 * radius + depth_error(v, here.w);
    // The four pixels that are drawn together lie between the same four texels: each looks one up.
    ivec2 odd = texel & 1;
    ivec2 first = ivec2(ceil(vec2(texel - odd + 1) * vec2(size) / vec2(screen) - 0.5)) - 1;
    ivec2 own = clamp(first + odd, ivec2(0), size - 1);
    ivec2 place = stands_for(own, size, screen);
    vec2 across = vec2(stands_for(clamp(first + 1 - odd, ivec2(0), size - 1), size, screen));
    vec2 near = clamp((across - vec2(texel)) / (across - vec2(place)), 0.0, 1.0);
    near = mix(near, vec2(1.0), equal(across, vec2(place)));  // at the picture's edge
    vec2 far = 1.0 - near;
    vec4 surface = look_up(surfaces, place, screen);
    Seen seen = Seen(view_position(v, (vec2(place) + 0.5) / vec2(screen), surface.w), surface.xyz,
                     look_up(source, own, size).PARTS);
    vec2 other = vec2(1 - 2 * odd);
    Seen above = from_y(seen, other.y);
    Around around = Around(Value(0.0), 0.0, false);
    add(around, position, here.xyz, seen, near.x * near.y, tolerance);
    add(around, position, here.xyz, from_x(seen, other.x), far.x * near.y, tolerance);
    add(around, position, here.xyz, above, near.x * far.y, tolerance);
    add(around, position, here.xyz, from_x(above, other.x), far.x * far.y, tolerance);
    // The four pixels that share what they find are marked together.
    float marked = here.w > 0.0 && (around.bends || around.total < 1e-3) ? 1.0 : 0.0;
    marked = max(marked, marked + other.x * dFdxFine(marked));
    marked = max(marked, marked + other.y * dFdyFine(marked));
    found = around.total > 0.0 ? around.sum / around.total : NOTHING;
    finish(found);
    gl_FragDepth = 1.0 - marked;
}
