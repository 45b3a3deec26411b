// Which layers of its material a program lights: CLEARCOAT_LAYER, SHEEN_LAYER, IRIDESCENCE_LAYER, TRANSMISSION_LAYER,
// and HAS_LAYERS with any of them. It lights those of the batch's material, per fragment of a geometry pass
// (FRAGMENT_LAYERS), where the shading model is physical.
#if defined(DIFFUSE_LOBE) && !defined(NEEDS_PHONG) && !defined(NEEDS_NOTHING)
#define PHYSICAL_LAYERS
#endif
#ifdef FRAGMENT_LAYERS
#ifdef PHYSICAL_LAYERS
#ifdef HAS_CLEARCOAT
#define CLEARCOAT_LAYER
#define HAS_LAYERS
#endif
#ifdef HAS_SHEEN
#define SHEEN_LAYER
#define HAS_LAYERS
#endif
#ifdef HAS_IRIDESCENCE
#define IRIDESCENCE_LAYER
#define HAS_LAYERS
#endif
#ifdef HAS_TRANSMISSION
#define TRANSMISSION_LAYER
#define HAS_LAYERS
#endif
#endif
#endif
