// Vertices of a shadow volume: those of the caster, and their extrusion away from the light. `LIGHT` is the light's
// index in the scene.
#include <lights.glsl>
#include <pass_view.glsl>

uniform float length_of_sides;  // metres; 0 extrudes to infinity

// Homogeneous position of the light: w = 1, or for a directional light the unit vector to it and w = 0.
vec4 light_position() {
    return lights[LIGHT].position;
}

vec4 to_clip(vec3 position) {
    return PASS_VIEW.view_projection * vec4(position, 1.0);
}

// Clip-space position of a near cap's vertex. The cap coincides with the lit face and must not be in front of it, so it
// is moved away from the eye by more than the rounding error of its depth. A polygon offset would also move the sides,
// and those that cross the eye's plane by an arbitrary distance.
vec4 to_cap(vec3 position) {
    const float ERROR = 16.0 / 16777216.0;  // relative to the value of a float
    vec4 clip = to_clip(position);
    clip.z -= ERROR * (PASS_VIEW.eye.w > 0.0 ? 2.0 * abs(clip.z) : clip.w);
    return clip;
}

// Clip-space position of a vertex extruded away from the light. To infinity it is (V - L, 0) for a local light, and the
// single point -L for a directional one (Everitt and Kilgard 2002). An orthographic view cannot show such points, so w
// is tiny there instead of 0, and the point is still beyond everything.
vec4 extrude(vec3 position) {
    vec4 light = light_position();
    vec3 direction = position * light.w - light.xyz;
    if (length_of_sides > 0.0) return to_clip(position + normalize(direction) * length_of_sides);
    float w = PASS_VIEW.eye.w > 0.0 ? 0.0 : 1e-5;
    return PASS_VIEW.view_projection * vec4(direction + w * position, w);
}

// Whether the volume has a far cap. It has none if all vertices are extruded to the same point at infinity.
bool has_far_cap() {
    return length_of_sides > 0.0 || light_position().w > 0.0 || PASS_VIEW.eye.w == 0.0;
}
