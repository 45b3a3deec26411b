// A level of a mip chain: the exact area average of the level above.
#include <downsample.glsl>

uniform sampler2D source;  // the level above
out vec4 level;

vec4 source_texel(ivec2 texel) {
    return texelFetch(source, texel, 0);
}

void main() {
    level = downsample(ivec2(gl_FragCoord.xy), textureSize(source, 0));
}
