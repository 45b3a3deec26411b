// Light that rays find through transmissive surfaces, without refraction.
#include <scene.glsl>
#include <trace.glsl>

#ifdef SCENE_ANY_TRANSMISSION
// Light that passes straight through a transmissive surface: all of it through a thin wall, and the root of this factor
// through each of the two sides of a volume.
vec3 passing_light(Hit hit) {
    MaterialData m = materials[MATERIAL_INDEX(scene_instance(hit.instance).material)];
    float factor = m.transmission.x * (1.0 - m.surface.x);
#ifdef SCENE_TRANSMISSION_ARRAYS
    ivec3 v = scene_triangle(hit.instance, hit.triangle);
    vec4 texel;
    SceneCoordinates c = scene_coordinates(v, scene_weights(hit.barycentrics));
    if (scene_texel(hit.instance, TRANSMISSION_SLOT, SCENE_TRANSMISSION_ARRAYS, c, texel)) factor *= texel.r;
#endif
    vec3 passed = m.base_color.rgb * (factor * (1.0 - m.extra.x));
    return m.transmission.y > 0.0 ? sqrt(passed) : passed;
}
#endif
