// The piece every shadow-map technique shares: which layer belongs to a light, where a point lies in it, and how far it
// is moved so that a surface does not shadow itself. The technique's own include comes first and defines
//
//     float map_visibility(int layer, vec3 place)    // texture coordinates and depth in that layer, 0 to 1
//     MAP_HALF_WIDTH                                 // half the width in texels of what it looks at
//
// With MAP_SLOPE it declares `vec2 map_slope` and `float map_texel` too: by how much the depth of the receiver's plane
// changes a texel across and a texel up, and how many metres a texel is.
//
// The offset: `across` and `up` are steps in the world of one texel of the map at an unchanged depth, whatever the
// projection. A plane in the world is one in the map, so what `across` has along its normal is how far the plane
// departs from that depth in a texel. Moved by this much along the normal, and as much for `up` since the kernel is a
// square, the point is above all of the plane that the kernel looks at. The offset vanishes where light falls straight
// on. A face turned away from the light is moved away from it, and so lies behind what it belongs to.
#ifndef MAP_VIEWS
#define MAP_VIEWS shadow_map_views
#define MAP_LIGHTS shadow_map_lights
#define MAP_LAYERS SHADOW_MAP_LAYERS
#endif

uniform float bias;           // texels towards the light
uniform float normal_offset;  // factor on what the slope asks for

// The place of a moved point in one layer; false where the layer does not see it.
bool place_in_layer(int layer, vec3 position, vec3 normal, out vec3 place) {
    View view = MAP_VIEWS[layer];
    vec4 clip = view.view_projection * vec4(position, 1.0);
    vec2 texel = 2.0 * clip.w * view.viewport.zw;
    mat4 back = view.inverse_view_projection;
    vec3 across = (back[0].xyz - position * back[0].w) * texel.x;
    vec3 up = (back[1].xyz - position * back[1].w) * texel.y;
    float lean = abs(dot(across, normal)) + abs(dot(up, normal));
    vec3 moved = normal * (normal_offset * MAP_HALF_WIDTH * lean);
    moved += view_dir(view, position) * (bias * max(length(across), length(up)));
    clip += view.view_projection * vec4(moved, 0.0);
    place = clip.xyz / clip.w;
#ifdef MAP_SLOPE
    map_texel = max(length(across), length(up));
    // The same plane in the map's own coordinates has the normal (across, up, deep) along these three.
    vec3 deep = back[2].xyz - position * back[2].w;
    float steep = max(abs(dot(deep, normal)), length(deep) / 20.0);  // on edge it has no end
    map_slope = -vec2(dot(across, normal), dot(up, normal)) / (clip.w * (dot(deep, normal) < 0.0 ? -steep : steep));
#endif
    bool inside = clip.w > 0.0 && all(lessThanEqual(abs(place.xy), vec2(1.0))) && !nearer(place.z, 1.0);
    place = vec3(place.xy * 0.5 + 0.5, max(place.z, 0.0));  // what lies beyond the far plane lies on it
    return inside;
}

// 1 where the light reaches the point. The first layer of the light decides that sees the point and has its distance
// from the eye in its span; where the next one's span has begun, they are blended.
float shadow(int light, vec3 position, vec3 normal) {
    vec3 place;
    float lit = 1.0;
#if MAP_LAYERS == 1  // some compilers index by the counter even of a loop that has one turn
    if (MAP_LIGHTS[0] == light && place_in_layer(0, position, normal, place)) lit = map_visibility(0, place);
#else
    float far_off = -(camera.view * vec4(position, 1.0)).z;
    float end = -1.0;
    for (int layer = 0; layer < MAP_LAYERS; ++layer) {
        vec2 span = MAP_VIEWS[layer].range.zw;
        if (MAP_LIGHTS[layer] != light || far_off < span.x || far_off >= span.y) continue;
        if (!place_in_layer(layer, position, normal, place)) continue;
        float one = map_visibility(layer, place);
        if (end > 0.0) return mix(lit, one, (far_off - span.x) / (end - span.x));
        lit = one;
        end = span.y;
        if (isinf(end)) break;
    }
#endif
    return lit;
}
