// A shadow volume's points: those of a caster as they are, and moved away from the light. `LIGHT` is the scene's index.
#include <lights.glsl>
#include <pass_view.glsl>

uniform float length_of_sides;  // metres; 0 reaches to infinity

// Position of the light with w = 1, or with w = 0 the unit vector to it.
vec4 light_place() {
    return lights[LIGHT].position;
}

vec4 clip_of(vec3 position) {
    return PASS_VIEW.view_projection * vec4(position, 1.0);
}

// To infinity: (V - L, 0) from a light with a place, and the one point -L for a directional one (Everitt and Kilgard
// 2002). A parallel view has no such points: there w is tiny instead of 0, which lies beyond everything.
vec4 extruded(vec3 position) {
    vec4 light = light_place();
    vec3 away = position * light.w - light.xyz;
    if (length_of_sides > 0.0) return clip_of(position + normalize(away) * length_of_sides);
    float w = PASS_VIEW.eye.w > 0.0 ? 0.0 : 1e-5;
    return PASS_VIEW.view_projection * vec4(away + w * position, w);
}

// Whether the extruded points are apart: not where all are one point at infinity.
bool has_far_end() {
    return length_of_sides > 0.0 || light_place().w > 0.0 || PASS_VIEW.eye.w == 0.0;
}
