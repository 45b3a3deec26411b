// Textures that have as many samples as what is drawn: a fragment looks at its own, and is run for each.
#if PASS_SAMPLES > 1
#define SAMPLER_2D sampler2DMS
#define SAMPLE_INDEX gl_SampleID
#else
#define SAMPLER_2D sampler2D
#define SAMPLE_INDEX 0
#endif
