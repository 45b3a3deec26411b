// The ray of the pass's view through a window position.
#include <pass_view.glsl>

struct CameraRay {
    vec3 origin;
    vec3 direction;  // unit
    float nearest;   // distances of the near and the far plane along it
    float farthest;
};

CameraRay camera_ray(vec2 uv) {
    View view = PASS_VIEW;
    vec3 at_near = view_space_position(view, uv, 1.0);
    bool has_eye = view.eye.w > 0.0;
    vec3 direction = has_eye ? normalize(at_near) : vec3(0.0, 0.0, -1.0);
    vec3 origin = has_eye ? vec3(0.0) : at_near;  // without an eye the near plane may be behind the view
    vec2 range = (has_eye ? view.range.xy : vec2(0.0, view.range.y - view.range.x)) / -direction.z;
    return CameraRay(
        (view.inverse_view * vec4(origin, 1.0)).xyz,
        normalize(mat3(view.inverse_view) * direction),
        range.x,
        range.y);
}
