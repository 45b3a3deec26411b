// A mesh that encloses everything a local light reaches, generated from vertex numbers: SEGMENTS around its axis and
// RINGS along it. A point light has a sphere; a spot light has a spherical sector whose last ring collapses to the
// light's position. The radius is enlarged so that the flat faces enclose the round shape.
#include <lights.glsl>
#include <math.glsl>

uniform int light;  // index in the scene

// The light's range; without one, the distance to the farthest corner of the view frustum.
float volume_radius(Light l) {
    if (l.color.w > 0.0) return 1.0 / l.color.w;
    float farthest = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        vec2 ndc = vec2(corner & 1, (corner >> 1) & 1) * 2.0 - 1.0;
        vec4 p = depth_views[0].inverse_view_projection * vec4(ndc, float(corner >> 2), 1.0);
        // An infinite far plane is replaced by a distance beyond all scenes.
        vec3 position = abs(p.w) > 1e-7 ? p.xyz / p.w : depth_views[0].eye.xyz + normalize(p.xyz) * 1e7;
        farthest = max(farthest, distance(position, l.position.xyz));
    }
    return farthest;
}

void main() {
    Light l = lights[light];
    int quad = gl_VertexID / 6;
    int corner = int[](0, 1, 2, 0, 2, 3)[gl_VertexID % 6];  // counter-clockwise from outside
    int ring = quad / SEGMENTS + (corner == 1 || corner == 2 ? 1 : 0);
    int segment = quad % SEGMENTS + (corner >= 2 ? 1 : 0);

    bool is_spot = l.cone.x > 0.0;
    float scale = 1.0 / cos(PI / float(SEGMENTS));  // of a polygon that encloses a circle
    float max_theta = PI;
    int rings = RINGS;
    if (is_spot) {
        rings = RINGS - 1;
        float outer = acos(clamp(-l.cone.y / l.cone.x, 0.0, 1.0)) + 1e-3;
        max_theta = outer < 1.56 ? atan(tan(outer) * scale) : PI / 2.0;
    }
    float theta = max_theta * float(ring) / float(rings);
    float phi = 2.0 * PI * float(segment % SEGMENTS) / float(SEGMENTS);
    vec3 axis = is_spot ? l.direction.xyz : vec3(0.0, 0.0, 1.0);
    vec3 tangent = -any_tangent(axis);
    vec3 direction = axis * cos(theta) + (tangent * cos(phi) + cross(axis, tangent) * sin(phi)) * sin(theta);
    float radius = volume_radius(l) * 1.001 * scale / cos(0.5 * max_theta / float(rings));
    if (is_spot && ring == RINGS) radius = 0.0;
    gl_Position = depth_views[0].view_projection * vec4(l.position.xyz + direction * radius, 1.0);
}
