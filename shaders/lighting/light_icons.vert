// A sign for each light, six times sixteen lines: a point light is a ball, in the ball of its range; a spot light is a
// disc with the rims of its cones; a directional one a disc with rays, on the side of the scene where it comes from.
#include <lights.glsl>
#include <math.glsl>
#include <pass_view.glsl>
#include <srgb.glsl>

layout(std430) readonly buffer bounds {
    vec4 middle_and_extent;  // the scene's
};
uniform float size;  // share of the extent

flat out vec3 g_tint;

vec3 on_circle(vec3 axis, float turn) {
    vec3 side = any_tangent(axis);
    return side * cos(2.0 * PI * turn) + cross(axis, side) * sin(2.0 * PI * turn);
}

vec3 point_light(Light l, float radius, int part, float turn) {
    float range = RANGES == 1 && l.color.w > 0.0 ? 1.0 / l.color.w : 0.0;
    vec3 axis = vec3(0.0);
    axis[part % 3] = 1.0;
    return l.position.xyz + on_circle(axis, turn) * (part < 3 ? radius : range);
}

vec3 spot_light(Light l, float radius, int part, float turn, bool last) {
    vec3 axis = l.direction.xyz;
    float reach = l.color.w > 0.0 ? 1.0 / l.color.w : 0.5 * middle_and_extent.w;
    float outer = -l.cone.y / l.cone.x;  // cosines
    float inner = outer + 1.0 / l.cone.x;
    float angle = part == 1 ? inner : outer;
    vec3 rim = l.position.xyz + reach * (axis * angle + on_circle(axis, turn) * sqrt(max(1.0 - angle * angle, 0.0)));
    if (part < 2) return rim;
    if (part == 2) return last ? rim : l.position.xyz;
    return l.position.xyz + on_circle(axis, turn) * (part == 3 ? radius : 0.0);
}

vec3 directional_light(Light l, float radius, int part, float turn, bool last) {
    vec3 axis = l.position.xyz;
    vec3 place = middle_and_extent.xyz + axis * 0.3 * middle_and_extent.w;
    vec3 around = on_circle(axis, turn) * radius;
    if (part == 0) return place + around;
    if (part == 1) return place + around * (last ? 2.0 : 1.4);
    return place - (part == 2 && last ? axis * 6.0 * radius : vec3(0.0)) + around * float(part == 2);
}

void main() {
    Light l = lights[gl_InstanceID];
    int line = gl_VertexID / 2, part = line / 16;
    bool last = (gl_VertexID & 1) == 1, straight = (l.direction.w == 0.0 && (part == 1 || part == 2)) ||
        (l.direction.w == 2.0 && part == 2);
    float turn = float(line % 16 + (last && !straight ? 1 : 0)) / 16.0;
    if (straight) turn = float(line % 8) / 8.0;
    float radius = size * middle_and_extent.w;
    vec3 place = l.direction.w == 0.0 ? directional_light(l, radius, part, turn, last)
        : l.direction.w == 1.0        ? point_light(l, radius, part, turn)
                                      : spot_light(l, radius, part, turn, last);
    gl_Position = PASS_VIEW.view_projection * vec4(place, 1.0);
    g_tint = linear_to_srgb(l.color.rgb / max(max(l.color.r, max(l.color.g, l.color.b)), 1e-9));
}
