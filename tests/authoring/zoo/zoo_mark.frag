uniform sampler2D result;
out float marks;
void main() { marks = step(0.5, texelFetch(result, ivec2(gl_FragCoord.xy), 0).r); }
