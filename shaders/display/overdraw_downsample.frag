// One mip level of mean (x) and maximum (y): the exact area mean of the level above, and the maximum over it.
#include <downsample.glsl>

uniform sampler2D source;  // the level above, or with FIRST the counts
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
            vec2 source_level = texelFetch(source, min(2 * texel + ivec2(x, y), size - 1), 0).xy;
#ifdef FIRST
            source_level.y = source_level.x;
#endif
            level.y = max(level.y, source_level.y);
        }
    }
}
