// Fog whose density falls exponentially with height: the integral of its extinction along a ray, in closed form.
uniform float density;
uniform float height;
uniform float falloff;
uniform vec3 color;

vec4 air_at(vec3 position) {
    // An orthographic camera has no eye: rays begin in the plane of the camera.
    vec3 to_viewer = camera.eye.xyz, plane = camera.inverse_view[3].xyz;
    vec3 begin = camera.eye.w > 0.0 ? camera.eye.xyz : position + to_viewer * dot(plane - position, to_viewer);
    float x = clamp(falloff * (position.y - begin.y), -60.0, 1e6);  // large enough for any fog, small enough for floats
    float series = 1.0 - x * (0.5 - x * (1.0 / 6.0 - x / 24.0));
    float mean = abs(x) < 0.1 ? series : (1.0 - exp(-x)) / x;  // of exp(-t x) for t from 0 to 1
    float extinction = density * exp(min(falloff * (height - begin.y), 60.0));
    float transmittance = exp(-extinction * mean * distance(position, begin));
    return vec4(color * (1.0 - transmittance), transmittance);
}
