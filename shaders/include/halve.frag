// A level of a mip chain: the exact area mean of the level above.
#include <halving.glsl>

uniform sampler2D source;  // the level above
out vec4 level;

vec4 halving_tap(ivec2 texel) {
    return texelFetch(source, texel, 0);
}

void main() {
    level = halved(ivec2(gl_FragCoord.xy), textureSize(source, 0));
}
