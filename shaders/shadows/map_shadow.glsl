// The piece every shadow-map technique shares: which layer belongs to a light, where a point lies in it, and how far it
// is moved so that a surface does not shadow itself. The technique's own include comes first and defines
//
//     float map_visibility(int layer, vec3 place)    // texture coordinates and depth in that layer, 0 to 1
//     MAP_HALF_WIDTH                                 // half the width in texels of what it looks at
//
// The offset: a receiver at the angle a to the light's plane is deeper by w tan(a) at the distance w in the map. Moving
// the point by w sin(a) along its normal lifts it by just that much, so the offset vanishes where light falls straight
// on. The kernel is a square and wider along its diagonal, which the sum of the normal's leans along both sides says. A
// face turned away from the light is moved away from it, and so lies behind what it belongs to.
#ifndef MAP_VIEWS
#if LIGHT_COUNT > 0 && LIGHT_DIRECTIONALS == LIGHT_COUNT
#define MAP_PARALLEL  // every view is orthographic: w is 1, and all points lie in one direction from the light
#endif
#define MAP_VIEWS shadow_map_views
#define MAP_LIGHTS shadow_map_lights
#define MAP_LAYERS SHADOW_MAP_LAYERS
#endif

uniform float bias;           // texels towards the light
uniform float normal_offset;  // factor on what the slope asks for

// Where a moved point lies in one layer, in clip space; `half_sides` are half the map's sides, in metres at w = 1.
#ifdef MAP_PARALLEL
// The light lies along the view's z axis: what a normal has across it is its lean, and the point is moved in clip
// space.
vec4 moved_in_layer(View view, vec3 position, vec3 normal, vec2 half_sides, float texel) {
    mat3 turned = mat3(view.view_projection);
    vec3 along = turned * normal;
    float lean = dot(abs(along.xy), half_sides);
    float offset = texel * normal_offset * MAP_HALF_WIDTH * lean;
    vec3 clip = turned * position + view.view_projection[3].xyz + along * offset;
    clip.z += texel * bias * view.projection[2][2];
    return vec4(clip, 1.0);
}
#else
vec4 moved_in_layer(View view, vec3 position, vec3 normal, vec2 half_sides, float texel) {
    vec3 to_light = to_viewer(view, position);
    texel *= (view.view_projection * vec4(position, 1.0)).w;
    vec3 lean = abs(mat3(view.view) * (normal - to_light * dot(normal, to_light)));
    float offset = normal_offset * MAP_HALF_WIDTH * (lean.x + lean.y + lean.z);
    return view.view_projection * vec4(position + texel * (normal * offset + to_light * bias), 1.0);
}
#endif

// The place of a moved point in one layer; false where the layer does not see it.
bool place_in_layer(int layer, vec3 position, vec3 normal, out vec3 place) {
    View view = MAP_VIEWS[layer];
    vec2 half_sides = vec2(view.inverse_projection[0][0], view.inverse_projection[1][1]);
    vec2 sides = view.viewport.zw * half_sides;
    float texel = 2.0 * max(sides.x, sides.y);  // metres across at w = 1
    vec4 clip = moved_in_layer(view, position, normal, half_sides, texel);
    place = clip.xyz / clip.w * 0.5 + 0.5;
    place.z = min(place.z, 1.0);
    return clip.w > 0.0 && all(greaterThanEqual(place, vec3(0.0))) && all(lessThanEqual(place.xy, vec2(1.0)));
}

// 1 where the light reaches the point; the first layer of the light that sees the point decides.
float shadow(int light, vec3 position, vec3 normal) {
    vec3 place;
#if MAP_LAYERS == 1  // some compilers index by the counter even of a loop that has one turn
    if (MAP_LIGHTS[0] == light && place_in_layer(0, position, normal, place)) return map_visibility(0, place);
#else
    for (int layer = 0; layer < MAP_LAYERS; ++layer) {
        if (MAP_LIGHTS[layer] == light && place_in_layer(layer, position, normal, place)) {
            return map_visibility(layer, place);
        }
    }
#endif
    return 1.0;
}
