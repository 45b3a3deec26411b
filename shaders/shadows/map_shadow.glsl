// Shared by all shadow-map techniques: which layer belongs to a light, the shadow-map coordinates of a point, and the
// offset against self-shadowing. The technique's own include comes first and defines
//
//     float map_visibility(int layer, vec3 coords)    // texture coordinates and depth in that layer, 0 to 1
//     MAP_HALF_WIDTH                                  // half the width of the filter kernel in texels
//
// With MAP_SLOPE it also declares `vec2 map_slope`, the change of the depth of the receiver's plane per texel to the
// right and per texel up, and `float map_texel`, the size of a texel in metres.
//
// The offset: `texel_x` and `texel_y` are world-space steps of one texel at constant depth, for any projection. A plane
// in the world is a plane in the map, so `dot(texel_x, normal)` is how far the receiver's plane departs from constant
// depth per texel. Moved along the normal by this distance for the x and the y axis of the square kernel, the point is
// above the whole part of the plane that the kernel covers. The offset vanishes where light arrives perpendicularly. A
// surface that faces away from the light is moved away from it, and so lies behind the front of its object.
#ifndef MAP_VIEWS
#define MAP_VIEWS shadow_map_views
#define MAP_LIGHTS shadow_map_lights
#define MAP_LAYERS SHADOW_MAP_LAYERS
#endif

uniform float bias;           // texels towards the light
uniform float normal_offset;  // scale of the normal offset

// Shadow-map coordinates of an offset point in one layer; false if the layer's view does not contain it.
bool shadow_map_coords(int layer, vec3 position, vec3 normal, out vec3 coords) {
    View view = MAP_VIEWS[layer];
    vec4 clip_position = view.view_projection * vec4(position, 1.0);
    vec2 clip_texel = 2.0 * clip_position.w * view.viewport.zw;
    mat4 clip_to_world = view.inverse_view_projection;
    vec3 texel_x = (clip_to_world[0].xyz - position * clip_to_world[0].w) * clip_texel.x;
    vec3 texel_y = (clip_to_world[1].xyz - position * clip_to_world[1].w) * clip_texel.y;
    float slope = abs(dot(texel_x, normal)) + abs(dot(texel_y, normal));
    vec3 offset = normal * (normal_offset * MAP_HALF_WIDTH * slope);
    offset += view_dir(view, position) * (bias * max(length(texel_x), length(texel_y)));
    clip_position += view.view_projection * vec4(offset, 0.0);
    coords = clip_position.xyz / clip_position.w;
#ifdef MAP_SLOPE
    map_texel = max(length(texel_x), length(texel_y));
    // In the coordinate system of texel_x, texel_y and depth_axis, the same plane has these three dot products as
    // normal.
    vec3 depth_axis = clip_to_world[2].xyz - position * clip_to_world[2].w;
    float NoD = dot(depth_axis, normal);
    float magnitude = max(abs(NoD), length(depth_axis) / 20.0);  // limits the slope, which is infinite if edge-on
    vec2 NoT = vec2(dot(texel_x, normal), dot(texel_y, normal));
    map_slope = -NoT / (clip_position.w * (NoD < 0.0 ? -magnitude : magnitude));
#endif
    bool is_inside = clip_position.w > 0.0 && all(lessThanEqual(abs(coords.xy), vec2(1.0))) && !nearer(coords.z, 1.0);
    coords = vec3(coords.xy * 0.5 + 0.5, max(coords.z, 0.0));  // points beyond the far plane are clamped to it
    return is_inside;
}

// Visibility of a light from a point. The lookup uses the first layer that belongs to the light, contains the point,
// and whose span contains the point's distance from the camera. Where the span of the next layer overlaps, the two are
// blended.
float shadow(int light, vec3 position, vec3 normal) {
    vec3 coords;
    float lit = 1.0;
#if MAP_LAYERS == 1  // without a loop, because some compilers index dynamically even in a loop of a single iteration
    if (MAP_LIGHTS[0] == light && shadow_map_coords(0, position, normal, coords)) {
        lit = map_visibility(0, coords);
    }
#else
    float view_distance = -(camera.view * vec4(position, 1.0)).z;
    float span_end = -1.0;
    for (int layer = 0; layer < MAP_LAYERS; ++layer) {
        vec2 span = MAP_VIEWS[layer].range.zw;
        if (MAP_LIGHTS[layer] != light || view_distance < span.x || view_distance >= span.y) continue;
        if (!shadow_map_coords(layer, position, normal, coords)) continue;
        float layer_visibility = map_visibility(layer, coords);
        if (span_end > 0.0) {
            return mix(lit, layer_visibility, (view_distance - span.x) / (span_end - span.x));
        }
        lit = layer_visibility;
        span_end = span.y;
        if (isinf(span_end)) break;
    }
#endif
    return lit;
}
