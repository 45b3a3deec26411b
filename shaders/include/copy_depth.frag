// Depth into another depth texture.
#include <each_sample.glsl>

uniform STORED depth;

void main() {
    gl_FragDepth = texelFetch(depth, ivec2(gl_FragCoord.xy), HERE).r;
}
