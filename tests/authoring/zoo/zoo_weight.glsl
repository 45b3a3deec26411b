uniform sampler2DArray layers;
uniform float slope;  // without effect where uv is 0
vec3 weight(vec2 uv, int n) { return texture(layers, vec3(uv, 0.0)).rgb + slope * uv.x; }
