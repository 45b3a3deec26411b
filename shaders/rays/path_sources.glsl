// Sources of light of a surface: punctual lights, the environment and emitting triangles. rendergraph provides
// `light_from()`.
#include <trace.glsl>
#include "density_table.glsl"
#include "environment_directions.glsl"
#include "offset_ray.glsl"
#include "path_light.glsl"
#include "path_visibility.glsl"
#include "random.glsl"

#ifdef HAS_ENVIRONMENT
uniform sampler2D environment_table;
uniform sampler2D environment_tree;
#endif
#ifdef USES_EMITTERS
uniform sampler2D emitter_table;
uniform sampler2D emitter_tree;
#endif

#ifdef USES_ENVIRONMENT
// Density with which the table chooses a direction, in 1/sr.
float environment_density(vec3 d) {
    float total = table_mean(environment_table).x;
    vec2 uv = table_uv(d), size = vec2(textureSize(environment_table, 0));
    float value = texelFetch(environment_table, ivec2(min(uv * size, size - 1.0)), 0).x;
    return total > 0.0 ? value / total / (2.0 * PI * PI * max(sin(PI * uv.y), 1e-6)) : 0.0;
}
#endif

#ifdef USES_EMITTERS
// Power of all emitting triangles in the unit of the table.
float emitted_power() {
    return table_mean(emitter_table).w * float(EMITTER_TABLE_SIDE * EMITTER_TABLE_SIDE);
}

// Radiance that a triangle emits towards a direction.
vec3 emission(int instance, int triangle, vec2 barycentrics) {
    vec3 radiance = materials[MATERIAL_INDEX(scene_instance(instance).material)].emissive.rgb;
#ifdef SCENE_EMISSIVE_ARRAYS
    ivec3 v = scene_triangle(instance, triangle);
    vec4 texel;
    SceneCoordinates c = scene_coordinates(v, scene_weights(barycentrics));
    if (scene_texel(instance, EMISSIVE_SLOT, SCENE_EMISSIVE_ARRAYS, c, texel)) radiance *= texel.rgb;
#endif
    return radiance;
}
#endif

// Chances that the light of a surface is sampled by punctual lights, the environment and emitting triangles.
vec3 source_chances(vec3 position, float lights) {
    vec3 chances = vec3(lights, 0.0, 0.0);
#ifdef USES_ENVIRONMENT
    chances.y = PI * PI / 2.0 * table_mean(environment_table).x;  // of its mean radiance, as irradiance
#endif
#ifdef USES_EMITTERS
    vec4 emitters = table_mean(emitter_table);
    vec3 offset = emitters.xyz / max(emitters.w, 1e-37) - position;
    chances.z = emitted_power() / max(dot(offset, offset), 1e-12);
#endif
    vec3 is_there = vec3(greaterThan(chances, vec3(0.0)));
    float sum = chances.x + chances.y + chances.z, count = is_there.x + is_there.y + is_there.z;
    return sum > 0.0 ? 0.85 * chances / sum + 0.15 * is_there / count : vec3(0.0);
}

// A point or direction of one source of light, which a shadow ray has yet to reach.
struct SourceSample {
    vec3 light;      // radiance times SPREAD_LIGHT, or irradiance of a punctual light; over the density of the choice
    vec3 light_dir;  // unit
    float density;   // of the choice in 1/sr; 0 for a punctual light, which nothing else finds
    bool is_environment;  // `light` and `density` still lack the environment's radiance and density
    vec3 ray;        // the direction of the shadow ray
    float reach;     // its length, in units of the length of this direction
    int casting;     // flags of objects that cast shadows
};

// Chooses a source by `chances` and a point or direction of it. The shadow ray begins at the surface.
SourceSample sample_source(
    Surface s, vec3 chances, float choice, int light, float light_chance, uint point, uint dimension) {
    SourceSample found = SourceSample(vec3(0.0), s.normal, 0.0, false, vec3(0.0), 1e30, 0);
    if (choice < chances.x) {
#ifdef USES_LIGHTS
        found.light = irradiance_from(lights[light], s.position, found.light_dir) / (chances.x * light_chance);
        bool has_position = lights[light].position.w > 0.0;
        found.ray = has_position ? lights[light].position.xyz - s.position : found.light_dir;
        found.reach = has_position ? 1.0 : found.reach;
        found.casting = SCENE_CASTS_SHADOW;
#endif
    } else if (choice < chances.x + chances.y) {
#ifdef USES_ENVIRONMENT
        ivec2 size = textureSize(environment_table, 0);
        vec2 xi = sobol_point(point, dimension + 0x200000u);
        ivec2 cell = sample_texel(environment_tree, size, xi);
        found.light_dir = table_direction((vec2(cell) + xi) / vec2(size));
        found.ray = found.light_dir;
        found.is_environment = true;
#endif
    } else if (chances.z > 0.0) {
#ifdef USES_EMITTERS
        vec2 xi = sobol_point(point, dimension + 0x200000u);
        ivec2 cell = sample_texel(emitter_tree, ivec2(EMITTER_TABLE_SIDE), xi);
        SceneEmitter emitter = scene_emitters[min(cell.y * EMITTER_TABLE_SIDE + cell.x, SCENE_EMITTER_COUNT - 1)];
        xi = sobol_point(point, dimension + 0x300000u);
        vec2 barycentrics = sqrt(xi.x) * vec2(1.0 - xi.y, xi.y);
        mat3 corners = scene_corners(emitter.instance, emitter.triangle);
        vec3 normal = scene_geometric_normal(emitter.instance, emitter.triangle);
        vec3 at = corners * scene_weights(barycentrics), offset = at - s.position;
        float square = dot(offset, offset), facing = -dot(offset, normal) * inversesqrt(square);
        if (scene_has(emitter.instance, SCENE_DOUBLE_SIDED) && facing < 0.0) {
            normal = -normal;
            facing = -facing;
        }
        float area = 0.5 * length(cross(corners[1] - corners[0], corners[2] - corners[0]));
        float chance = texelFetch(emitter_table, cell, 0).w / max(emitted_power(), 1e-37);
        found.light_dir = offset * inversesqrt(square);
        found.density = chances.z * chance / max(area, 1e-37) * square / max(facing, 1e-9);
        if (facing > 0.0 && square > 0.0) {
            found.light = emission(emitter.instance, emitter.triangle, barycentrics)
                * (SPREAD_LIGHT * opacity(emitter.instance, emitter.triangle, barycentrics)
                    / max(found.density, 1e-37));
        }
        found.ray = offset_ray(emitter.instance, at, normal) - s.position;
        found.reach = 1.0;
#endif
    }
    return found;
}

// Weight of the emission that a ray has hit with `density`, while the last surface could have chosen emitters with
// probability `chance`.
float emission_weight(Hit hit, vec3 normal, vec3 direction, float density, float chance) {
#ifdef USES_EMITTERS
    int first = scene_instance(hit.instance).first_emitter, number = first + hit.triangle;
    ivec2 at = ivec2(number % EMITTER_TABLE_SIDE, number / EMITTER_TABLE_SIDE);
    float radiance = luminance_of(materials[MATERIAL_INDEX(scene_instance(hit.instance).material)].emissive.rgb);
    // A triangle is chosen with a probability proportional to its area; this is the probability per area, as a density
    // of directions.
    float chosen = chance * radiance / max(emitted_power(), 1e-37) * hit.distance * hit.distance
        / max(abs(dot(normal, direction)), 1e-9);
    bool is_chosen = first >= 0 && texelFetch(emitter_table, max(at, 0), 0).w > 0.0;
    return is_chosen ? power_heuristic(density, chosen) : 1.0;
#else
    return 1.0;
#endif
}
