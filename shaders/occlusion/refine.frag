// A smaller picture at full size where that is as good as computing it: where some of the four around a pixel lie on
// its own surface, and those in its plane differ little. All others are marked in the depth, for passes that are drawn
// over these alone: a triangle at the far plane passes where 0 is. The test comes before a shader, for whole blocks.
// (L. Bavoil and M. Sainz, "Multi-Layer Dual-Resolution Screen-Space Ambient Occlusion", 2009)
#include "surfaces.glsl"
#include "finish.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;
uniform float radius;    // metres
uniform float contrast;  // of those that are interpolated
uniform int blur;        // texels; without one, noise is not put between noise
out Value found;  // the same, for the passes that filter what is marked

void main() {
    View v = surfaces_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 screen = textureSize(surfaces, 0);
    ivec2 size = textureSize(source, 0);
    vec4 here = texelFetch(surfaces, texel, 0);
    vec2 place = (vec2(texel) + 0.5) / vec2(screen);
    vec3 position = view_position(v, place, here.w);
    float tolerance = 0.1 * radius + depth_error(v, here.w);
    ivec2 first = ivec2(floor(place * vec2(size) - 0.5));
    ivec2 low = max(first, 0);
    ivec2 high = min(first + 1, size - 1);
    ivec2 start = stands_for(low, size, screen);
    ivec2 end = stands_for(high, size, screen);
    vec2 from = (vec2(start) + 0.5) / vec2(screen);
    vec2 to = (vec2(end) + 0.5) / vec2(screen);
    vec2 share = clamp((place - from) / max(to - from, 1e-6), 0.0, 1.0);
    Value sum = Value(0.0);
    float total = 0.0;
    float least = 1.0;
    float most = 0.0;
    for (int i = 0; i < 4; ++i) {
        bvec2 corner = bvec2(i & 1, i >> 1);
        ivec2 there = mix(low, high, corner);
        vec4 seen = look_up(surfaces, mix(start, end, corner), screen);
        Value value = look_up(source, there, size).PARTS;
        vec3 offset = view_position(v, mix(from, to, vec2(corner)), seen.w) - position;
        bool near = seen.w > 0.0 && abs(dot(offset, here.xyz)) < tolerance;
        vec2 part = mix(1.0 - share, share, vec2(corner));
        float weight = in_plane(offset, here.xyz, seen.xyz, tolerance) ? part.x * part.y : 0.0;
        sum += weight * value;
        total += weight;
        float open = openness(value);
        least = near ? min(least, open) : least;
        most = near ? max(most, open) : most;
    }
    bool refine = blur == 0 || total < 1e-3 || most - least > contrast;
    // The four pixels that share what they find are marked together.
    float marked = refine && here.w > 0.0 ? 1.0 : 0.0;
    vec2 other = vec2(1 - 2 * (texel & 1));
    marked = max(marked, marked + other.x * dFdxFine(marked));
    marked = max(marked, marked + other.y * dFdyFine(marked));
    found = here.w > 0.0 && total > 0.0 ? sum / total : NOTHING;
    finish(found);
    gl_FragDepth = 1.0 - marked;
}
