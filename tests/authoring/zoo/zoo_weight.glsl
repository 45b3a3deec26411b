uniform sampler2DArray layers;
vec3 weight(vec2 uv, int n) { return texture(layers, vec3(uv, 0.0)).rgb; }
