// Which layers of its material a program lights: CLEARCOAT_LAYER, SHEEN_LAYER, IRIDESCENCE_LAYER, TRANSMISSION_LAYER,
// and HAS_LAYERS with any of them. Where the shading model is physical, fragments of a geometry pass (FRAGMENT_LAYERS)
// have those of the batch's material, and programs that define SCENE_LAYERS have all that are in the scene.
#if defined(DIFFUSE_LOBE) && !defined(NEEDS_PHONG) && !defined(NEEDS_NOTHING)
#define PHYSICAL_LAYERS
#endif
#if defined(PHYSICAL_LAYERS) \
    && ((defined(FRAGMENT_LAYERS) && defined(HAS_CLEARCOAT)) || (defined(SCENE_LAYERS) && defined(SCENE_ANY_CLEARCOAT)))
#define CLEARCOAT_LAYER
#define HAS_LAYERS
#endif
#if defined(PHYSICAL_LAYERS) \
    && ((defined(FRAGMENT_LAYERS) && defined(HAS_SHEEN)) || (defined(SCENE_LAYERS) && defined(SCENE_ANY_SHEEN)))
#define SHEEN_LAYER
#define HAS_LAYERS
#endif
#if defined(PHYSICAL_LAYERS) \
    && ((defined(FRAGMENT_LAYERS) && defined(HAS_IRIDESCENCE)) \
        || (defined(SCENE_LAYERS) && defined(SCENE_ANY_IRIDESCENCE)))
#define IRIDESCENCE_LAYER
#define HAS_LAYERS
#endif
#if defined(PHYSICAL_LAYERS) \
    && ((defined(FRAGMENT_LAYERS) && defined(HAS_TRANSMISSION)) \
        || (defined(SCENE_LAYERS) && defined(SCENE_ANY_TRANSMISSION)))
#define TRANSMISSION_LAYER
#define HAS_LAYERS
#endif
