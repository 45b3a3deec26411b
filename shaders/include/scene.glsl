// The scene as data, for steps that read an input of `SceneData`: maps an instance, one of its triangles and
// barycentrics to positions, normals and the `Surface` that geometry passes shade. An instance is an object of the
// scene, with the same number. Triangles are numbered within their mesh, as in `gl_PrimitiveID` of a geometry pass.
// Barycentrics are the weights of the triangle's second and third vertex.
#include <material_surface.glsl>
#include <layers.glsl>
#include <math.glsl>
#include <scene_textures.glsl>
#include <surface.glsl>

// Like `tangent_frame()` of `fragment_surface.glsl`: the mesh's own tangents, or else tangents along the texture
// coordinates of the normal map. `v`, `w` and `corners` are the triangle's vertices, their weights and their
// world-space positions.
void scene_tangent_frame(
    int instance, ivec3 v, vec3 w, mat3 corners, vec3 normal, out vec3 tangent, out vec3 bitangent) {
#ifdef SCENE_TANGENTS_STREAM
    if (scene_has(instance, SCENE_HAS_TANGENTS)) {
        vec4 local =
            scene_vertex_tangent(v.x) * w.x + scene_vertex_tangent(v.y) * w.y + scene_vertex_tangent(v.z) * w.z;
        tangent = normalize(scene_direction_to_world(instance, local.xyz));
        bitangent = cross(normal, tangent) * (scene_has(instance, SCENE_MIRRORED) ? -local.w : local.w);
        return;
    }
#endif
    int set = 0;
#ifdef SCENE_NORMAL_ARRAYS
    set = scene_texture(MATERIAL_INDEX(scene_instance(instance).material), NORMAL_SLOT).w & 1;
#endif
    vec2 uv = scene_vertex_uv(v.x, set);
    vec2 uv_a = scene_vertex_uv(v.y, set) - uv, uv_b = scene_vertex_uv(v.z, set) - uv;
    uv_tangent_frame(
        normal, corners[1] - corners[0], corners[2] - corners[0], uv_a, uv_b, tangent, bitangent);
}

#if defined(SCENE_LAYERS) && defined(HAS_LAYERS)
// The layers' texels at a point, like `layer_texels` of `fragment_layers.glsl`. `normal` is that of the geometry, with
// its tangent frame, and `c` are the texture coordinates; `flip_normal` reverses the normals of maps.
LayerTexels scene_layer_texels(
    int instance, SceneCoordinates c, MaterialData m, vec3 normal, vec3 tangent, vec3 bitangent, bool flip_normal) {
    LayerTexels layers = LayerTexels(vec2(1.0), vec4(1.0), vec2(1.0), vec2(1.0), normal);
#ifdef SCENE_TEXTURES
    vec4 texel;
#endif
#if defined(SCENE_CLEARCOAT_ARRAYS) && defined(CLEARCOAT_LAYER)
    if (scene_texel(instance, CLEARCOAT_SLOT, SCENE_CLEARCOAT_ARRAYS, c, texel)) layers.clearcoat.x = texel.r;
#endif
#if defined(SCENE_CLEARCOAT_ROUGHNESS_ARRAYS) && defined(CLEARCOAT_LAYER)
    if (scene_texel(instance, CLEARCOAT_ROUGHNESS_SLOT, SCENE_CLEARCOAT_ROUGHNESS_ARRAYS, c, texel)) {
        layers.clearcoat.y = texel.g;
    }
#endif
#if defined(SCENE_SHEEN_COLOR_ARRAYS) && defined(SHEEN_LAYER)
    if (scene_texel(instance, SHEEN_COLOR_SLOT, SCENE_SHEEN_COLOR_ARRAYS, c, texel)) layers.sheen.rgb = texel.rgb;
#endif
#if defined(SCENE_SHEEN_ROUGHNESS_ARRAYS) && defined(SHEEN_LAYER)
    if (scene_texel(instance, SHEEN_ROUGHNESS_SLOT, SCENE_SHEEN_ROUGHNESS_ARRAYS, c, texel)) layers.sheen.a = texel.a;
#endif
#if defined(SCENE_IRIDESCENCE_ARRAYS) && defined(IRIDESCENCE_LAYER)
    if (scene_texel(instance, IRIDESCENCE_SLOT, SCENE_IRIDESCENCE_ARRAYS, c, texel)) layers.iridescence.x = texel.r;
#endif
#if defined(SCENE_IRIDESCENCE_THICKNESS_ARRAYS) && defined(IRIDESCENCE_LAYER)
    if (scene_texel(instance, IRIDESCENCE_THICKNESS_SLOT, SCENE_IRIDESCENCE_THICKNESS_ARRAYS, c, texel)) {
        layers.iridescence.y = texel.g;
    }
#endif
#if defined(SCENE_TRANSMISSION_ARRAYS) && defined(TRANSMISSION_LAYER)
    if (scene_texel(instance, TRANSMISSION_SLOT, SCENE_TRANSMISSION_ARRAYS, c, texel)) layers.transmission.x = texel.r;
#endif
#if defined(SCENE_THICKNESS_ARRAYS) && defined(TRANSMISSION_LAYER)
    if (scene_texel(instance, THICKNESS_SLOT, SCENE_THICKNESS_ARRAYS, c, texel)) layers.transmission.y = texel.g;
#endif
#if defined(SCENE_CLEARCOAT_NORMAL_ARRAYS) && defined(CLEARCOAT_LAYER)
    if (scene_texel(instance, CLEARCOAT_NORMAL_SLOT, SCENE_CLEARCOAT_NORMAL_ARRAYS, c, texel)) {
        vec3 bump = texel.xyz * 2.0 - 1.0;
        bump.xy *= m.clearcoat.z;
        layers.clearcoat_normal = normalize(mat3(tangent, bitangent, normal) * bump);
    }
#endif
    if (flip_normal) layers.clearcoat_normal = -layers.clearcoat_normal;
    return layers;
}
#endif

// Everything a shading model reads: the surface that a geometry pass shades there, seen along -view_dir. Nothing is
// discarded: `scene_alpha` is compared with the material's cutoff by the caller, if SCENE_MASKED is defined.
Surface scene_surface(int instance, int triangle, vec2 barycentrics, vec3 view_dir) {
    int flags = scene_instance(instance).flags;
    MaterialData m = materials[MATERIAL_INDEX(scene_instance(instance).material)];
    ivec3 v = scene_triangle(instance, triangle);
    vec3 w = scene_weights(barycentrics);
    mat3 corners = scene_corners(instance, triangle);
    SceneCoordinates c = scene_coordinates(v, w);
    Surface s;
    s.position = corners * w;
    s.view_dir = view_dir;
    vec3 front = scene_geometric_normal(instance, triangle);
    bool is_front = dot(front, view_dir) >= 0.0;
    s.geometric_normal = is_front ? front : -front;

    vec4 base = scene_base_color(instance, v, w, c);
    s.base_color = base.rgb;
    s.alpha = (flags & SCENE_BLENDED) != 0 ? base.a : 1.0;

    vec3 normal = scene_normal_to_world(instance, scene_vertex_normal(v.x)) * w.x;
    normal += scene_normal_to_world(instance, scene_vertex_normal(v.y)) * w.y;
    normal += scene_normal_to_world(instance, scene_vertex_normal(v.z)) * w.z;
    // Objects that are scaled to a plane, and those of some files, have no normals.
    s.normal = dot(normal, normal) > 1e-30 ? normalize(normal) : front;

    MaterialTexels texels = no_texels();
#ifdef SCENE_TEXTURES
    vec4 texel;
#endif
#ifdef SCENE_METALLIC_ROUGHNESS_ARRAYS
    texels.has_metallic_roughness =
        scene_texel(instance, METALLIC_ROUGHNESS_SLOT, SCENE_METALLIC_ROUGHNESS_ARRAYS, c, texel);
    texels.metallic_roughness = texel.rgb;
#endif
#ifdef SCENE_SPECULAR_ARRAYS
    if (scene_texel(instance, SPECULAR_SLOT, SCENE_SPECULAR_ARRAYS, c, texel)) texels.specular.a = texel.a;
#endif
#ifdef SCENE_SPECULAR_COLOR_ARRAYS
    if (scene_texel(instance, SPECULAR_COLOR_SLOT, SCENE_SPECULAR_COLOR_ARRAYS, c, texel)) {
        texels.specular.rgb = texel.rgb;
    }
#endif
#ifdef SCENE_NORMAL_ARRAYS
    texels.has_normal = scene_texel(instance, NORMAL_SLOT, SCENE_NORMAL_ARRAYS, c, texel);
    texels.normal = texel.xyz;
#endif
#if defined(SCENE_ANISOTROPY_ARRAYS) && defined(NEEDS_GRAIN)
    texels.has_anisotropy = scene_texel(instance, ANISOTROPY_SLOT, SCENE_ANISOTROPY_ARRAYS, c, texel);
    texels.anisotropy = texel.rgb;
#endif
#ifdef SCENE_OCCLUSION_ARRAYS
    texels.has_occlusion = scene_texel(instance, OCCLUSION_SLOT, SCENE_OCCLUSION_ARRAYS, c, texel);
    texels.occlusion = texel.r;
#endif
#ifdef SCENE_EMISSIVE_ARRAYS
    if (scene_texel(instance, EMISSIVE_SLOT, SCENE_EMISSIVE_ARRAYS, c, texel)) texels.emissive = texel.rgb;
#endif
#if defined(NEEDS_GRAIN) || defined(SCENE_CLEARCOAT_NORMAL_ARRAYS)
    bool needs_frame = true;
#else
    bool needs_frame = texels.has_normal;
#endif
    if (needs_frame) scene_tangent_frame(instance, v, w, corners, s.normal, s.tangent, s.bitangent);
    bool flip_normal = !is_front && (flags & SCENE_DOUBLE_SIDED) != 0;
#if defined(SCENE_LAYERS) && defined(HAS_LAYERS)
    LayerTexels layers = scene_layer_texels(instance, c, m, s.normal, s.tangent, s.bitangent, flip_normal);
#endif
    material_surface(s, m, texels, flip_normal, (flags & SCENE_UNLIT) == 0);
#if defined(SCENE_LAYERS) && defined(HAS_LAYERS)
    vec4 rows[3] = scene_instance(instance).rows;
    material_layers(s, m, layers, pow(abs(dot(rows[0].xyz, cross(rows[1].xyz, rows[2].xyz))), 1.0 / 3.0));
#endif
    return s;
}
