// A level of a chain of means and maxima: the exact area mean of the level above, and the most of what it covers.
#include <downsample.glsl>

uniform sampler2D source;  // the level above; with FIRST the counts themselves
out vec2 level;

vec4 source_texel(ivec2 texel) {
    return texelFetch(source, texel, 0);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy), size = textureSize(source, 0);
    level.x = downsample(texel, size).x;
    level.y = 0.0;
    for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) {
            vec2 above = texelFetch(source, min(2 * texel + ivec2(x, y), size - 1), 0).xy;
#ifdef FIRST
            above.y = above.x;
#endif
            level.y = max(level.y, above.y);
        }
    }
}
