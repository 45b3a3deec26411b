// Directions on an equirectangular table of the environment: u around +Y, v from the top.
#include <math.glsl>

vec3 table_direction(vec2 uv) {
    float phi = 2.0 * PI * uv.x, theta = PI * uv.y;
    return vec3(cos(phi) * sin(theta), cos(theta), sin(phi) * sin(theta));
}

vec2 table_uv(vec3 d) {
    float phi = abs(d.x) + abs(d.z) > 0.0 ? atan(d.z, d.x) : 0.0;
    return vec2(fract(phi / (2.0 * PI) + 1.0), acos(clamp(d.y, -1.0, 1.0)) / PI);
}
