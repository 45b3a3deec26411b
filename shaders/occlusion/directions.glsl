// Sampling directions on the screen. Each pixel samples surfaces along DIRECTIONS lines, from near to far. Directions
// are rotated and steps are jittered in a pattern of 16 combinations, one for each pixel of a 4×4 block, so that
// averaging a block amounts to 16 times as many samples (the pattern of J. Jimenez et al., "Practical Real-Time
// Strategies for Accurate Indirect Occlusion", 2016).
#include <math.glsl>
#if ANIMATED
#include <frame.glsl>
#endif

#ifndef STEPS
// Prefers steps to directions: neighbouring pixels add directions, but never what lies between two steps.
#define STEPS (SAMPLES < 16 ? 4 : 8)
#endif
#ifndef DIRECTIONS
#define DIRECTIONS (SAMPLES / STEPS / 2 * 2)
#endif

#ifdef BLOCK_PATTERN
// 4×4 blocks differ as well, in a pattern of BLOCK_PATTERN × BLOCK_PATTERN blocks (a power of two), so that a filter
// over many blocks averages different samples. If all blocks had the same samples, a small bright surface missed by one
// block would be missed by all around it.

// The rank of a block in a pattern of `size` × `size`, 0 to 1. All ranks differ and are evenly spaced.
float block_rank(ivec2 block, int size) {
    int diagonal = block.x + block.y & size - 1;
    return (float(diagonal * size + (block.x & size - 1)) + 0.5) / float(size * size);
}
#endif

// The first of `count` directions of this pixel, a unit vector on the screen.
vec2 first_direction(int count) {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float rotation = float((texel.x + texel.y & 3) << 2 | texel.x & 3) + 0.5;
#ifdef BLOCK_PATTERN
    rotation += block_rank(texel >> 2, BLOCK_PATTERN) - 0.5;
#endif
#if ANIMATED
    rotation = 16.0 * fract(rotation / 16.0 + 0.618034 * float(frame_index & 1023));
#endif
    float angle = 2.0 * PI * rotation / (16.0 * float(count));
    return vec2(cos(angle), sin(angle));
}

// The position of the samples of a direction within their steps, 0 to 1.
float step_jitter(int direction_index) {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float jitter = float((texel.y - texel.x & 3) << 2 | texel.y & 3) + 0.5;
#ifdef BLOCK_PATTERN
    jitter += 16.0 * block_rank((texel >> 2).yx * ivec2(1, -1), BLOCK_PATTERN);
#endif
#if ANIMATED
    jitter += 16.0 * 0.754878 * float(frame_index & 1023);
#endif
    return fract(jitter / 16.0 + 0.618034 * float(direction_index));
}

// The next of `count` directions, counter-clockwise.
vec2 next_direction(vec2 direction, int count) {
    float angle = 2.0 * PI / float(count);
    return mat2(cos(angle), sin(angle), -sin(angle), cos(angle)) * direction;
}

// The projected size of a length in metres, in window coordinates along both axes, at a clip-space w.
vec2 projected_length(View v, float length, float w) {
    return 0.5 * length / w * vec2(v.projection[0][0], v.projection[1][1]);
}
