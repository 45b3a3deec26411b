// Screen-space ambient occlusion by points in the hemisphere above each surface, which are projected onto the picture.
// Each ray has four points: one in the narrow hemisphere, three in the wide one. There are no branches besides the
// loops: rasterisers that run many pixels at once would execute both sides, which is slower.
#include "surfaces.glsl"
#include "quad_mean.glsl"
#if ANIMATED
#include <frame.glsl>
#endif
uniform sampler2D surfaces;
uniform sampler2D noise;
uniform ivec2 screen_size;
uniform float radius;   // of the wide hemisphere, in metres
uniform float nearest;  // distance from the camera below which nothing is computed, in metres
uniform int blur;       // in texels; with a blur, quads of four pixels are averaged
uniform vec3 directions[SAMPLES / 4];
out float unfiltered;

const float NARROW_RADIUS = 0.2;    // relative to the wide one
const float DEPTH_THRESHOLD = 4.0;  // in radii

// The position of a point along its ray, as a fraction; `jitter` is 0 to 1.
float ray_fraction(int step, float jitter) {
    if (step == 0) return NARROW_RADIUS * (0.4 + 0.6 * jitter);
    return NARROW_RADIUS + (1.0 - NARROW_RADIUS) * (float(step - 1) + jitter) / 3.0;
}

// The origin of a pixel's rays. Homogeneous texel positions are texels times clip-space w, and w.
struct RayOrigin {
    vec3 position;
    vec4 surface;
    vec3 homogeneous;         // texel position
    mat3 homogeneous_change;  // of the texel position, per radius along each axis of view space
    vec4 inverse_margins;     // one over the distances to the edges of the picture
};

RayOrigin make_origin(View view, ivec2 texel, vec2 size) {
    vec4 surface = texelFetch(surfaces, texel, 0);
    vec2 uv = texel_uv(texel, ivec2(size), screen_size);
    float w = clip_w(view, surface.w);
    vec3 homogeneous = vec3(uv * size, 1.0) * w;
    mat4 p = view.projection;
    mat3 change = 0.5 * radius * mat3(
        size.x * p[0][0], 0.0, 0.0, 0.0, size.y * p[1][1], 0.0, size * (p[2].xy + p[2][3]), 2.0 * p[2][3]);
    vec4 inverse_margins = 1.0 / vec4(size * w - homogeneous.xy, homogeneous.xy);
    return RayOrigin(view_position(view, uv, surface.w), surface, homogeneous, change, inverse_margins);
}

// Occlusion along a ray, 0 to 1.
float ray_occlusion(View view, RayOrigin origin, ivec2 size, vec3 direction, float jitter) {
    vec3 homogeneous_direction = origin.homogeneous_change * direction;
    vec4 exits = vec4(homogeneous_direction.xy - vec2(size) * homogeneous_direction.z, -homogeneous_direction.xy)
        * origin.inverse_margins;
    // A ray that leaves the picture is shortened, so that all of its points lie on it.
    float ray_length = 0.9999 / max(max(max(exits.x, exits.y), max(exits.z, exits.w)), 0.9999);
    float occlusion = 0.0;
    float back_occlusion = 0.0;    // by a surface that faces away, whose thickness is unknown
    float inverse_crossing = 0.0;  // one over the fraction at which the ray crosses that surface
    for (int step = 0; step < 4; ++step) {
        float t = ray_length * ray_fraction(step, jitter);
        vec3 homogeneous = origin.homogeneous + t * homogeneous_direction;
        ivec2 sample_texel = ivec2(homogeneous.xy / homogeneous.z);
        vec4 sample_surface = fetch_texel(surfaces, sample_texel, size);
        vec3 offset = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w)
            - origin.position;
        float depth_difference = -origin.position.z - t * radius * direction.z - sample_surface.w;
        float plane_offset = dot(offset, sample_surface.xyz);
        float plane_change = dot(direction, sample_surface.xyz) * radius;
        bool is_hidden = depth_difference > 0.0;
        is_hidden = is_hidden && sample_surface.w > 0.0;
        bool faces_away = plane_offset > 0.0;
        // Surfaces occlude within the radius, and farther away if their plane crosses the ray before the point.
        bool crosses_plane = t * plane_change < plane_offset;
        crosses_plane = crosses_plane && !faces_away;
        bool in_radius = dot(offset, offset) <= radius * radius;
        float max_distance = max(origin.surface.w, sample_surface.w);
        bool is_occluder = is_above_tangent_plane(view, offset, origin.surface.xyz, max_distance);
        is_occluder = is_occluder && (in_radius || crosses_plane);
        // Decreases with the difference of depth, to 0 at the threshold.
        float relative_difference = depth_difference / (DEPTH_THRESHOLD * radius);
        float weight = is_occluder ? max(1.0 - relative_difference * relative_difference, 0.0) : 0.0;
        // If the ray is visible again, it either crossed the surface that faces away, or passed behind a thin object.
        float crossed = t * inverse_crossing > 1.0 ? back_occlusion : 0.0;
        float crossing = plane_change / plane_offset;
        occlusion = max(occlusion, is_hidden ? (faces_away ? 0.0 : weight) : crossed);
        back_occlusion = is_hidden ? max(back_occlusion, faces_away ? weight : 0.0) : 0.0;
        inverse_crossing = is_occluder && faces_away ? crossing : inverse_crossing;
    }
    return max(occlusion, back_occlusion);
}

void main() {
    View view = surfaces_views[0];
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(surfaces, 0);
    RayOrigin origin = make_origin(view, current_surface_texel(size), vec2(size));
#if ANIMATED
    vec4 random = texelFetch(noise, pixel + frame_index * ivec2(37, 19) & 63, 0);
#else
    vec4 random = texelFetch(noise, pixel & 63, 0);
#endif
    vec3 mirror_normal = normalize(random.xyz);
    float occlusion = 0.0;
    int count = origin.surface.w > nearest ? SAMPLES / 4 : 0;
    for (int i = 0; i < count; ++i) {
        // The sum of the normal and a uniform unit vector is cosine-distributed over the hemisphere.
        vec3 direction = origin.surface.xyz + reflect(directions[i], mirror_normal);
        direction *= inversesqrt(max(dot(direction, direction), 1e-12));
        float jitter = fract(random.w * 0.5 + 0.5 + float(i) * 0.618034);
        occlusion += ray_occlusion(view, origin, size, direction, jitter);
    }
    unfiltered = 1.0 - occlusion / float(SAMPLES / 4);
    float tolerance = 0.1 * radius + depth_error(view, origin.surface.w);
    if (blur > 0) unfiltered = quad_mean(vec4(unfiltered), origin.surface, origin.position, tolerance).x;
}
