uniform sampler2D result;
out vec4 lit;
void main() { lit = texelFetch(result, ivec2(gl_FragCoord.xy), 0); }
