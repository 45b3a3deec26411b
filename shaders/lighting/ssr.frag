// Screen-space reflections: rays that step over the depth buffer, evenly on the screen (M. McGuire and M. Mara,
// "Efficient GPU Screen-Space Ray Tracing", 2014), and a picture that is blurred by a cone (Y. Uludag, "Hi-Z
// Screen-Space Cone-Traced Reflections", 2014). It writes the change of the picture where the reflection found replaces
// that of the environment.
#include <depth_surface.glsl>
#include <frame.glsl>
#include <math.glsl>
uniform sampler2D lit;  // with all levels
uniform sampler2D normal;
uniform sampler2D material;
uniform sampler2D environment_reflection;
uniform sampler2D specular_albedo;
uniform float reach;      // metres
uniform float thickness;  // metres
uniform float max_roughness;
uniform float fade;
out vec4 change;

// Window coordinates of a view-space position, and in z 1 over its clip-space w.
vec3 on_screen(View v, vec3 position) {
    vec4 clip = v.projection * vec4(position, 1.0);
    return vec3(clip.xy / clip.w * 0.5 + 0.5, 1.0 / clip.w);
}

// The distance of the surface at window coordinates, along the view axis in metres; far away for the background.
float scene_distance(View v, vec2 uv) {
    float found = texelFetch(depth, ivec2(uv * v.viewport.xy), 0).r;
    return is_nothing(found) ? 1e30 : linear_depth(v, found);
}

// The part of a line from `start` to `end` on the screen, 0 to 1.
float part_on_screen(vec2 start, vec2 end) {
    vec2 way = end - start;
    vec2 part = mix(start, 1.0 - start, greaterThan(way, vec2(0.0))) / max(abs(way), vec2(1e-9));
    return clamp(min(part.x, part.y), 0.0, 1.0);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    View v = depth_views[0];
    float window_depth, roughness = texelFetch(material, texel, 0).y;
    vec3 world = position_at(texel, TEXEL_CENTER, window_depth);
    vec3 albedo = texelFetch(specular_albedo, texel, 0).rgb;
    change = vec4(0.0);
    if (is_nothing(window_depth) || roughness >= max_roughness || albedo == vec3(0.0)) return;

    mat3 to_view = mat3(v.view);
    vec3 n = to_view * normalize(texelFetch(normal, texel, 0).xyz);
    vec3 position = (v.view * vec4(world, 1.0)).xyz, to_viewer = to_view * view_dir(v, world);
    vec3 ray = reflect(-to_viewer, n);
    float distance = -position.z;
    vec3 start = position + n * (2.0 * pixel_height(distance));
    // The ray ends before the near plane.
    float travel = ray.z > 0.0 ? min(reach, 0.95 * (distance - v.range.x) / ray.z) : reach;
    vec3 end = start + ray * max(travel, 0.0);
    vec3 from = on_screen(v, start), to = on_screen(v, end);
    // 1 / w and distance / w are linear on the screen.
    float first = -start.z * from.z, last = -end.z * to.z, share = part_on_screen(from.xy, to.xy);
    to = mix(from, to, share);
    last = mix(first, last, share);

    float jitter = fract(52.9829189 * fract(dot(vec2(texel), vec2(0.06711056, 0.00583715))));  // Jimenez 2014
    float before = 0.0, hit = -1.0;
    for (int i = 0; i < STEPS && hit < 0.0; ++i) {
        float t = (float(i) + 0.5 + 0.5 * jitter) / float(STEPS);
        vec3 at = mix(from, to, t);
        float along = mix(first, last, t) / at.z, behind = along - scene_distance(v, at.xy);
        float advance = abs(along - mix(first, last, before) / mix(from.z, to.z, before));
        if (behind > 0.0 && behind < thickness + advance) hit = t;
        else before = t;
    }
    if (hit < 0.0) return;
    for (int i = 0; i < 6; ++i) {  // bisects for the point where the ray passes behind the surface
        float middle = 0.5 * (before + hit);
        vec3 at = mix(from, to, middle);
        bool is_behind = mix(first, last, middle) / at.z > scene_distance(v, at.xy);
        hit = is_behind ? middle : hit;
        before = is_behind ? before : middle;
    }
    vec3 at = mix(from, to, hit);
    float found = scene_distance(v, at.xy);
    if (mix(first, last, hit) / at.z - found > thickness) return;  // the ray passes behind a thin surface
    ivec2 there = ivec2(at.xy * v.viewport.xy);
    vec3 met = view_space_position(v, at.xy, texelFetch(depth, there, 0).r);
    vec3 other = to_view * texelFetch(normal, there, 0).xyz;
    if (dot(other, ray) > 0.0) return;  // the back of a surface is not in the picture

    float length_met = length(met - position), cone = roughness * roughness * length_met / pixel_height(found);
    vec3 reflected = textureLod(lit, at.xy, log2(max(cone, 1.0))).rgb;
    vec2 edge = min(at.xy, 1.0 - at.xy) / max(fade, 1e-6);
    float confidence = clamp(min(edge.x, edge.y), 0.0, 1.0);
    confidence *= clamp(2.0 - 2.0 * roughness / max(max_roughness, 1e-6), 0.0, 1.0);
    confidence *= clamp(4.0 - 4.0 * length_met / reach, 0.0, 1.0);
    vec3 environment = texelFetch(environment_reflection, texel, 0).rgb;
    change = vec4(confidence * albedo * (reflected - environment), 0.0);
}
