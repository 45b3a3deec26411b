// Arms: lines on the screen away from a pixel, along which it looks at surfaces from near to far. Each pixel turns and
// stretches its arms in one of 16 ways, and any 4×4 pixels have them all: what they share is one pixel with 16 times as
// many arms (the pattern of J. Jimenez et al., "Practical Real-Time Strategies for Accurate Indirect Occlusion", 2016).
#include <math.glsl>
#if ANIMATED
#include <frame.glsl>
#endif

#ifndef STEPS
// Steps before arms: what lies between steps is never seen, while neighbours have other arms.
#define STEPS (SAMPLES < 16 ? 4 : 8)
#endif
#ifndef ARMS
#define ARMS (SAMPLES / STEPS / 2 * 2)
#endif

#ifdef BLOCKS
// Blocks of 4×4 pixels differ too, in a pattern of BLOCKS × BLOCKS (a power of two), so that a filter over many blocks
// averages other samples in each: otherwise a small bright surface that one block misses, all around it miss as well.

// The rank of a block in a pattern of `size` × `size`, 0 to 1: all different, and evenly spaced.
float block_rank(ivec2 block, int size) {
    int sum = block.x + block.y & size - 1;
    return (float(sum * size + (block.x & size - 1)) + 0.5) / float(size * size);
}
#endif

// Unit vector of this pixel's arm 0 of `arms` on the screen.
vec2 first_arm(int arms) {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float turn = float((texel.x + texel.y & 3) << 2 | texel.x & 3) + 0.5;
#ifdef BLOCKS
    turn += block_rank(texel >> 2, BLOCKS) - 0.5;
#endif
#if ANIMATED
    turn = 16.0 * fract(turn / 16.0 + 0.618034 * float(frame_index & 1023));
#endif
    float angle = 2.0 * PI * turn / (16.0 * float(arms));
    return vec2(cos(angle), sin(angle));
}

// How far the samples of its arm lie within their steps, 0 to 1.
float stretch_of(int arm) {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float stretch = float((texel.y - texel.x & 3) << 2 | texel.y & 3) + 0.5;
#ifdef BLOCKS
    stretch += 16.0 * block_rank((texel >> 2).yx * ivec2(1, -1), BLOCKS);
#endif
#if ANIMATED
    stretch += 16.0 * 0.754878 * float(frame_index & 1023);
#endif
    return fract(stretch / 16.0 + 0.618034 * float(arm));
}

// The next arm counter-clockwise.
vec2 turned(vec2 along, int arms) {
    float angle = 2.0 * PI / float(arms);
    return mat2(cos(angle), sin(angle), -sin(angle), cos(angle)) * along;
}

// What a length in metres at a point covers of the window, 0 to 1, along its axes; `w` is clip space's there.
vec2 covered(View v, float length, float w) {
    return 0.5 * length / w * vec2(v.projection[0][0], v.projection[1][1]);
}
