// Ambient visibility: the fraction of cosine-weighted rays that hit nothing within the radius.
#include <depth_surface.glsl>
#include <frame.glsl>
#include <ray_directions.glsl>
#include <trace.glsl>
#include "surfaces.glsl"
#include "traced_origin.glsl"
#ifdef FIRST_RAY  // this step traces a part of the rays
out vec4 rays;
#else
#include "outputs.glsl"
#define FIRST_RAY 0
#define PAST_RAY SAMPLES
#define IS_LAST
#endif
#ifdef HAS_SUM
uniform sampler2D sum;
#endif

uniform sampler2D normal;    // world space
uniform ivec2 reduced_size;  // of the target
uniform float radius;        // metres

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 texel = screen_texel(pixel, reduced_size, textureSize(depth, 0));
    float window_depth;
    vec3 position = position_at(texel, TEXEL_CENTER, window_depth);
    if (is_nothing(window_depth)) {
#ifdef IS_LAST
        write_outputs(OPEN_VALUE);
#else
        rays = vec4(0.0);
#endif
        return;
    }
    vec4 open = vec4(0.0);  // xyz: sum of the unoccluded directions, w: their number
#ifdef HAS_SUM
    open = texelFetch(sum, pixel, 0);
#else
    vec3 axis = normalize(texelFetch(normal, texel, 0).xyz);
    vec3 origin = ray_origin(texel, position, axis, window_depth);
    vec2 shift = random_shift(pixel, ANIMATED * frame_index);
    for (int i = FIRST_RAY; i < PAST_RAY; ++i) {
        vec3 ray = cosine_direction(axis, shifted_point(i, shift));
        Hit hit;
        if (!nearest_hit(origin, ray, 0.0, radius, hit)) open += vec4(ray, 1.0);
    }
#endif
#ifdef IS_LAST
    open.w /= float(SAMPLES);
#ifdef HAS_VECTOR
    write_outputs(open);
#else
    write_outputs(open.w);
#endif
#else
    rays = open;
#endif
}
