// A smaller picture at full size: bilinear, but only from texels that lie on the pixel's own surface; where none does,
// from all four. (J. Kopf et al., "Joint Bilateral Upsampling", 2007)
#include "surfaces.glsl"
#include "finish.glsl"
uniform sampler2D source;
uniform sampler2D surfaces;  // of the smaller size
uniform sampler2D depth;
uniform sampler2D normal;
uniform float radius;        // metres

void main() {
    View v = depth_views[0];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    ivec2 screen = textureSize(depth, 0);
    float d = texelFetch(depth, texel, 0).r;
    if (is_nothing(d)) {
        finish(NOTHING);
        return;
    }
    float distance = linear_depth(v, d);
    vec2 place = (vec2(texel) + 0.5) / vec2(screen);
    vec3 position = view_position(v, place, distance);
    vec3 facing = normalize(mat3(v.view) * texelFetch(normal, texel, 0).xyz);
    vec2 at = place * vec2(size) - 0.5;
    ivec2 first = ivec2(floor(at));
    vec2 share = at - vec2(first);
    Value sum = Value(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 corner = ivec2(i & 1, i >> 1);
        ivec2 there = clamp(first + corner, ivec2(0), size - 1);
        vec4 seen = look_up(surfaces, there, size);
        if (seen.w == 0.0) continue;
        vec2 near = mix(1.0 - share, share, vec2(corner)) + 1e-3;
        vec3 offset = view_position(v, place_for(there, size, screen), seen.w) - position;
        float alike = same_surface(offset, facing, seen.xyz, 0.1 * radius + depth_error(v, distance));
        float weight = near.x * near.y * (alike + 1e-4);
        sum += weight * look_up(source, there, size).PARTS;
        total += weight;
    }
    finish(total > 0.0 ? sum / total : NOTHING);
}
