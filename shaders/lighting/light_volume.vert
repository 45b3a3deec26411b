// A mesh around everything a local light reaches, SEGMENTS around its axis and RINGS along it, made of vertex numbers.
// A point light has a sphere; a spot light a sector of one, whose last ring lies in the light. Points are moved out so
// far that the flat faces stay outside the round shape.
#include <lights.glsl>
#include <math.glsl>

uniform int light;  // the scene's index

// As far as the light's range; without one, to the farthest corner that the picture shows.
float reach(Light l) {
    if (l.color.w > 0.0) return 1.0 / l.color.w;
    float farthest = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        vec2 side = vec2(corner & 1, (corner >> 1) & 1) * 2.0 - 1.0;
        vec4 p = depth_views[0].inverse_view_projection * vec4(side, float(corner >> 2), 1.0);
        // A far plane at infinity: farther than anybody looks.
        vec3 place = abs(p.w) > 1e-7 ? p.xyz / p.w : depth_views[0].eye.xyz + normalize(p.xyz) * 1e7;
        farthest = max(farthest, distance(place, l.position.xyz));
    }
    return farthest;
}

void main() {
    Light l = lights[light];
    int quad = gl_VertexID / 6;
    int corner = int[](0, 1, 2, 0, 2, 3)[gl_VertexID % 6];  // counter-clockwise from outside
    int ring = quad / SEGMENTS + (corner == 1 || corner == 2 ? 1 : 0);
    int segment = quad % SEGMENTS + (corner >= 2 ? 1 : 0);

    bool spot = l.cone.x > 0.0;
    float across = 1.0 / cos(PI / float(SEGMENTS));  // a polygon around a circle
    float last = PI;
    int rings = RINGS;
    if (spot) {
        rings = RINGS - 1;
        float outer = acos(clamp(-l.cone.y / l.cone.x, 0.0, 1.0)) + 1e-3;
        last = outer < 1.56 ? atan(tan(outer) * across) : PI / 2.0;
    }
    float angle = last * float(ring) / float(rings);
    float around = 2.0 * PI * float(segment % SEGMENTS) / float(SEGMENTS);
    vec3 axis = spot ? l.direction.xyz : vec3(0.0, 0.0, 1.0);
    vec3 side = -any_tangent(axis);
    vec3 place = axis * cos(angle) + (side * cos(around) + cross(axis, side) * sin(around)) * sin(angle);
    float radius = reach(l) * 1.001 * across / cos(0.5 * last / float(rings));
    if (spot && ring == RINGS) radius = 0.0;
    gl_Position = depth_views[0].view_projection * vec4(l.position.xyz + place * radius, 1.0);
}
