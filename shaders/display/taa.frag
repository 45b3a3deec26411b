// What frames before have gathered, where this pixel was then, and the mean with this frame's picture of it.
// B. Karis, "High Quality Temporal Supersampling", 2014; M. Salvi, "An Excursion in Temporal Supersampling", 2016.
#include <frame.glsl>
#include <srgb.glsl>
#include <velocity.glsl>

uniform sampler2D source;  // this frame's picture, as it is displayed
uniform sampler2D depth;
#ifdef HAS_VELOCITY
uniform sampler2D velocity;
#endif
uniform sampler2D before;  // last frame's `gathered`
uniform int frames;
uniform int frames_at_rest;
uniform float tolerance;
out vec4 color;
out vec4 gathered;  // the mean, linear; how many frames it is of

vec3 ycocg(vec3 c) {
    return vec3(dot(c, vec3(0.25, 0.5, 0.25)), dot(c, vec3(0.5, 0.0, -0.5)), dot(c, vec3(-0.25, 0.5, -0.25)));
}

vec3 rgb(vec3 c) {
    return vec3(c.x + c.y - c.z, c.x + c.z, c.x - c.y - c.z);
}

vec3 shown(ivec2 texel) {
    texel = clamp(texel, ivec2(0), textureSize(source, 0) - 1);
    return ycocg(srgb_to_linear(texelFetch(source, texel, 0).rgb));
}

float depth_at(ivec2 texel) {
    return texelFetch(depth, clamp(texel, ivec2(0), textureSize(depth, 0) - 1), 0).r;
}

// How far what a pixel shows has moved. Beside something nearer that is what is nearer, whose smooth edge lies here: a
// step in depth towards a neighbour where there is none away from it. Of several the one that is nearer by least.
vec2 movement(ivec2 texel) {
    ivec2 nearest = texel;
    float here = depth_at(texel), d = here, least = 1.0;
    for (int i = 0; i < 9; ++i) {
        ivec2 way = ivec2(i % 3, i / 3) - 1;
        float other = depth_at(texel + way), step_away = abs(here - depth_at(texel - way));
        if (other - here > 2.0 * step_away + 0.01 * here && other < least) {
            least = d = other;
            nearest = clamp(texel + way, ivec2(0), textureSize(depth, 0) - 1);
        }
    }
#ifdef HAS_VELOCITY
    if (!is_nothing(d)) return texelFetch(velocity, nearest, 0).xy;
#endif
    vec2 uv = (vec2(nearest) + 0.5) * depth_views[0].viewport.zw;
    return static_velocity(depth_views[0], previous_depth_views[0], uv, d);
}

// A look-up that does not blur what is looked up again and again: cubic, by Catmull and Rom, of nine bilinear ones.
vec4 sharp(vec2 place) {
    vec2 size = vec2(textureSize(before, 0));
    vec2 middle = floor(place * size - 0.5) + 0.5, f = place * size - middle;
    vec2 w0 = f * (-0.5 + f * (1.0 - 0.5 * f)), w3 = f * f * (-0.5 + 0.5 * f);
    vec2 w1 = 1.0 + f * f * (-2.5 + 1.5 * f), w2 = 1.0 - w0 - w1 - w3;
    vec2 at[3] = vec2[]((middle - 1.0) / size, (middle + w2 / (w1 + w2)) / size, (middle + 2.0) / size);
    vec2 weight[3] = vec2[](w0, w1 + w2, w3);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 3; ++x)
            sum += weight[x].x * weight[y].y * texture(before, vec2(at[x].x, at[y].y));
    ivec2 first = ivec2(middle - 0.5), last = textureSize(before, 0) - 1;  // and within the four around: no ringing
    vec4 a = texelFetch(before, clamp(first, ivec2(0), last), 0);
    vec4 b = texelFetch(before, clamp(first + ivec2(1, 0), ivec2(0), last), 0);
    vec4 c = texelFetch(before, clamp(first + ivec2(0, 1), ivec2(0), last), 0);
    vec4 d = texelFetch(before, clamp(first + ivec2(1, 1), ivec2(0), last), 0);
    return vec4(clamp(sum, min(min(a, b), min(c, d)), max(max(a, b), max(c, d))).rgb, texture(before, place).a);
}

// What was gathered, brought as near to the colours around as `tolerance` asks; w is how much of it was left.
vec4 clipped(vec3 old, ivec2 texel) {
    vec3 mean = vec3(0.0), square = vec3(0.0);
    for (int i = 0; i < 9; ++i) {
        vec3 c = shown(texel + ivec2(i % 3, i / 3) - 1);
        mean += c / 9.0;
        square += c * c / 9.0;
    }
    vec3 reach = tolerance * sqrt(max(square - mean * mean, 0.0)) + 1.0 / 255.0;
    vec3 off = abs(old - mean) / reach;
    float left = 1.0 / max(max(max(off.x, off.y), off.z), 1.0);
    return vec4(mean + (old - mean) * left, left);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 given = texelFetch(source, texel, 0);
    vec3 now = shown(texel);
    vec4 old;
    float most = float(frames);
    if (still_frames > 0) {
        old = texelFetch(before, texel, 0);
        most = float(max(frames, frames_at_rest));
        old.rgb = ycocg(old.rgb);
    } else {
        vec2 place = gl_FragCoord.xy / vec2(textureSize(source, 0)) - movement(texel);
        bool seen = all(greaterThanEqual(place, vec2(0.0))) && all(lessThanEqual(place, vec2(1.0)));
        old = seen ? sharp(place) : vec4(0.0);
        vec4 kept = clipped(ycocg(old.rgb), texel);
        old = vec4(kept.rgb, min(old.a, most));
    }
    float count = min(floor(old.a + 0.5), most - 1.0) + 1.0;
    vec3 mean = count > 1.0 ? mix(old.rgb, now, 1.0 / count) : now;
    gathered = vec4(rgb(mean), count);
    color = vec4(linear_to_srgb(clamp(rgb(mean), 0.0, 1.0)), given.a);
}
