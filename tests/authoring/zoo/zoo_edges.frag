in vec3 v_normal;
out vec4 edges;
void main() { edges = vec4(abs(v_normal), 1.0); }
