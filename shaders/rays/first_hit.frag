// The surface visible at a pixel's centre.
#include <trace.glsl>
#include "camera_ray.glsl"
#ifdef WRITES_ALBEDO
out vec4 albedo;
#endif
#ifdef WRITES_NORMAL
out vec4 normal;
#endif
#ifdef WRITES_INSTANCE
out float instance;
#endif

void main() {
    View view = PASS_VIEW;
    CameraRay ray = camera_ray(gl_FragCoord.xy * view.viewport.zw);
    Hit hit;
    bool is_hit = visible_hit(ray.origin, ray.direction, ray.nearest, ray.farthest, hit);
    Surface s = scene_surface(max(hit.instance, 0), max(hit.triangle, 0), hit.barycentrics, -ray.direction);
#ifdef WRITES_ALBEDO
    albedo = is_hit ? vec4(s.base_color, 1.0) : vec4(0.0);
#endif
#ifdef WRITES_NORMAL
    normal = is_hit ? vec4(s.normal, 0.0) : vec4(0.0);
#endif
#ifdef WRITES_INSTANCE
    instance = is_hit ? float(hit.instance + 1) : 0.0;
#endif
    vec4 clip = view.view_projection * vec4(ray.origin + hit.distance * ray.direction, 1.0);
    gl_FragDepth = is_hit ? clip.z / clip.w : 0.0;
}
