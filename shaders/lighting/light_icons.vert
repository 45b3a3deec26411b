// An icon for each light, made of six parts of sixteen lines: a point light is a ball, inside a ball of its range; a
// spot light is a disc with the rims of its cones; a directional light is a disc with rays, on the side of the scene
// that it comes from.
#include <lights.glsl>
#include <math.glsl>
#include <pass_view.glsl>
#include <srgb.glsl>

layout(std430) readonly buffer bounds {
    vec4 center_and_extent;  // of the scene
};
uniform float size;  // as a fraction of the extent

flat out vec3 g_tint;

// Point on the unit circle around an axis; `turn` is 1 for a full turn.
vec3 on_circle(vec3 axis, float turn) {
    vec3 tangent = any_tangent(axis);
    return tangent * cos(2.0 * PI * turn) + cross(axis, tangent) * sin(2.0 * PI * turn);
}

vec3 point_light(Light l, float radius, int part, float turn) {
    float range = RANGES == 1 && l.color.w > 0.0 ? 1.0 / l.color.w : 0.0;
    vec3 axis = vec3(0.0);
    axis[part % 3] = 1.0;
    return l.position.xyz + on_circle(axis, turn) * (part < 3 ? radius : range);
}

vec3 spot_light(Light l, float radius, int part, float turn, bool is_end) {
    vec3 axis = l.direction.xyz;
    float length_of_cone = l.color.w > 0.0 ? 1.0 / l.color.w : 0.5 * center_and_extent.w;
    float cos_outer = -l.cone.y / l.cone.x;
    float cos_inner = cos_outer + 1.0 / l.cone.x;
    float cosine = part == 1 ? cos_inner : cos_outer, sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    vec3 rim = l.position.xyz + length_of_cone * (axis * cosine + on_circle(axis, turn) * sine);
    if (part < 2) return rim;
    if (part == 2) return is_end ? rim : l.position.xyz;
    return l.position.xyz + on_circle(axis, turn) * (part == 3 ? radius : 0.0);
}

vec3 directional_light(Light l, float radius, int part, float turn, bool is_end) {
    vec3 axis = l.position.xyz;
    vec3 center = center_and_extent.xyz + axis * 0.3 * center_and_extent.w;
    vec3 offset = on_circle(axis, turn) * radius;
    if (part == 0) return center + offset;
    if (part == 1) return center + offset * (is_end ? 2.0 : 1.4);
    return center - (part == 2 && is_end ? axis * 6.0 * radius : vec3(0.0)) + offset * float(part == 2);
}

void main() {
    Light l = lights[gl_InstanceID];
    int line = gl_VertexID / 2, part = line / 16;
    bool is_end = (gl_VertexID & 1) == 1, is_straight = (l.direction.w == 0.0 && (part == 1 || part == 2)) ||
        (l.direction.w == 2.0 && part == 2);
    float turn = float(line % 16 + (is_end && !is_straight ? 1 : 0)) / 16.0;
    if (is_straight) turn = float(line % 8) / 8.0;
    float radius = size * center_and_extent.w;
    vec3 position = l.direction.w == 0.0 ? directional_light(l, radius, part, turn, is_end)
        : l.direction.w == 1.0           ? point_light(l, radius, part, turn)
                                         : spot_light(l, radius, part, turn, is_end);
    gl_Position = PASS_VIEW.view_projection * vec4(position, 1.0);
    g_tint = linear_to_srgb(l.color.rgb / max(max(l.color.r, max(l.color.g, l.color.b)), 1e-9));
}
