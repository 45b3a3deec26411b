// Temporal antialiasing: reprojects the history to this frame, clips it to the colours of the neighbourhood, and blends
// the new frame into it.
// B. Karis, "High Quality Temporal Supersampling", 2014; M. Salvi, "An Excursion in Temporal Supersampling", 2016.
#include <frame.glsl>
#include <srgb.glsl>
#include <velocity.glsl>

uniform sampler2D source;  // this frame, display-referred
uniform sampler2D depth;
#ifdef HAS_VELOCITY
uniform sampler2D velocity;
#endif
uniform sampler2D previous_history;
uniform int frames;
uniform int frames_at_rest;
uniform float tolerance;
out vec4 color;
out vec4 history;  // the mean, display-linear; in alpha the number of frames in it
#if TRANSPARENT
uniform sampler2D previous_coverage;
out float coverage;  // mean of alpha
#endif

vec3 rgb_to_ycocg(vec3 c) {
    return vec3(dot(c, vec3(0.25, 0.5, 0.25)), dot(c, vec3(0.5, 0.0, -0.5)), dot(c, vec3(-0.25, 0.5, -0.25)));
}

vec3 ycocg_to_rgb(vec3 c) {
    return vec3(c.x + c.y - c.z, c.x + c.z, c.x - c.y - c.z);
}

vec3 source_ycocg(ivec2 texel) {
    texel = clamp(texel, ivec2(0), textureSize(source, 0) - 1);
#if TRANSPARENT
    return rgb_to_ycocg(display_to_light(texelFetch(source, texel, 0)).rgb);
#else
    return rgb_to_ycocg(srgb_to_linear(texelFetch(source, texel, 0).rgb));
#endif
}

float depth_at(ivec2 texel) {
    return texelFetch(depth, clamp(texel, ivec2(0), textureSize(depth, 0) - 1), 0).r;
}

// The motion of a pixel. Next to a nearer surface it is that of this surface, whose antialiased edge covers the pixel.
// A neighbour is on a nearer surface if depth steps towards it but not in the opposite direction. Of several
// neighbours, the farthest counts.
vec2 motion_at(ivec2 texel) {
    ivec2 nearest = texel;
    float center = depth_at(texel), window_depth = center, farthest = 1.0;
    for (int i = 0; i < 9; ++i) {
        ivec2 direction = ivec2(i % 3, i / 3) - 1;
        float neighbor = depth_at(texel + direction), opposite_step = abs(center - depth_at(texel - direction));
        if (neighbor - center > 2.0 * opposite_step + 0.01 * center && neighbor < farthest) {
            farthest = window_depth = neighbor;
            nearest = clamp(texel + direction, ivec2(0), textureSize(depth, 0) - 1);
        }
    }
#ifdef HAS_VELOCITY
    if (!is_nothing(window_depth)) return texelFetch(velocity, nearest, 0).xy;
#endif
    vec2 uv = (vec2(nearest) + 0.5) * depth_views[0].viewport.zw;
    return static_velocity(depth_views[0], previous_depth_views[0], uv, window_depth);
}

// The history by a Catmull-Rom filter of nine bilinear samples, which stays sharp when it is resampled in every frame.
// Clamping to the four nearest texels removes ringing.
vec4 sample_history(vec2 uv) {
    vec2 size = vec2(textureSize(previous_history, 0));
    vec2 center = floor(uv * size - 0.5) + 0.5, f = uv * size - center;
    vec2 w0 = f * (-0.5 + f * (1.0 - 0.5 * f)), w3 = f * f * (-0.5 + 0.5 * f);
    vec2 w1 = 1.0 + f * f * (-2.5 + 1.5 * f), w2 = 1.0 - w0 - w1 - w3;
    vec2 position[3] = vec2[]((center - 1.0) / size, (center + w2 / (w1 + w2)) / size, (center + 2.0) / size);
    vec2 weight[3] = vec2[](w0, w1 + w2, w3);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 3; ++x)
            sum += weight[x].x * weight[y].y * texture(previous_history, vec2(position[x].x, position[y].y));
    ivec2 first = ivec2(center - 0.5), last = textureSize(previous_history, 0) - 1;
    vec4 a = texelFetch(previous_history, clamp(first, ivec2(0), last), 0);
    vec4 b = texelFetch(previous_history, clamp(first + ivec2(1, 0), ivec2(0), last), 0);
    vec4 c = texelFetch(previous_history, clamp(first + ivec2(0, 1), ivec2(0), last), 0);
    vec4 d = texelFetch(previous_history, clamp(first + ivec2(1, 1), ivec2(0), last), 0);
    vec4 clamped = clamp(sum, min(min(a, b), min(c, d)), max(max(a, b), max(c, d)));
    return vec4(clamped.rgb, texture(previous_history, uv).a);
}

// Variance clipping: moves a colour towards the mean of the 3×3 neighbourhood, until it differs by at most `tolerance`
// standard deviations.
vec3 clip_to_neighborhood(vec3 value, ivec2 texel) {
    vec3 mean = vec3(0.0), mean_squared = vec3(0.0);
    for (int i = 0; i < 9; ++i) {
        vec3 c = source_ycocg(texel + ivec2(i % 3, i / 3) - 1);
        mean += c / 9.0;
        mean_squared += c * c / 9.0;
    }
    vec3 extent = tolerance * sqrt(max(mean_squared - mean * mean, 0.0)) + 1.0 / 255.0;
    vec3 relative = abs(value - mean) / extent;
    float scale = 1.0 / max(max(max(relative.x, relative.y), relative.z), 1.0);
    return mean + (value - mean) * scale;
}

#if TRANSPARENT
// The mean of alpha at `uv`, clamped to the range of alpha in the 3×3 neighbourhood of a texel.
float moved_coverage(vec2 uv, ivec2 texel) {
    float least = 1.0, most = 0.0;
    for (int i = 0; i < 9; ++i) {
        ivec2 at = clamp(texel + ivec2(i % 3, i / 3) - 1, ivec2(0), textureSize(source, 0) - 1);
        float alpha = texelFetch(source, at, 0).a;
        least = min(least, alpha);
        most = max(most, alpha);
    }
    return clamp(texture(previous_coverage, uv).r, least, most);
}
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 source_color = texelFetch(source, texel, 0);
    vec3 current = source_ycocg(texel);
    vec4 previous;
    float max_count = float(frames);
    if (still_frames > 0) {
        previous = texelFetch(previous_history, texel, 0);
        max_count = float(max(frames, frames_at_rest));
        previous.rgb = rgb_to_ycocg(previous.rgb);
#if TRANSPARENT
        coverage = texelFetch(previous_coverage, texel, 0).r;
#endif
    } else {
        vec2 uv = gl_FragCoord.xy / vec2(textureSize(source, 0)) - motion_at(texel);
        bool on_screen = all(greaterThanEqual(uv, vec2(0.0))) && all(lessThanEqual(uv, vec2(1.0)));
        previous = on_screen ? sample_history(uv) : vec4(0.0);
        vec3 clipped = clip_to_neighborhood(rgb_to_ycocg(previous.rgb), texel);
        previous = vec4(clipped, min(previous.a, max_count));
#if TRANSPARENT
        coverage = moved_coverage(uv, texel);
#endif
    }
    float count = min(floor(previous.a + 0.5), max_count - 1.0) + 1.0;
    vec3 mean = count > 1.0 ? mix(previous.rgb, current, 1.0 / count) : current;
    history = vec4(ycocg_to_rgb(mean), count);
#if TRANSPARENT
    coverage = count > 1.0 ? mix(coverage, source_color.a, 1.0 / count) : source_color.a;
    color = light_to_display(vec4(clamp(ycocg_to_rgb(mean), 0.0, coverage), coverage));
#else
    color = vec4(linear_to_srgb(clamp(ycocg_to_rgb(mean), 0.0, 1.0)), source_color.a);
#endif
}
