// Textures that have as many samples as what is drawn: a fragment looks at its own, and is run for each.
#if PASS_SAMPLES > 1
#define STORED sampler2DMS
#define HERE gl_SampleID
#else
#define STORED sampler2D
#define HERE 0
#endif
