layout(local_size_x = 16) in;
uniform sampler2D result;
layout(std430) buffer numbers { float of_them[16]; };
void main() { of_them[gl_LocalInvocationIndex] = texelFetch(result, ivec2(gl_LocalInvocationIndex, 0), 0).r; }
