// For passes that read textures with as many samples as they render to. Reading SAMPLE_INDEX runs the shader per
// sample.
#if PASS_SAMPLES > 1
#define SAMPLER_2D sampler2DMS
#define SAMPLE_INDEX gl_SampleID
#else
#define SAMPLER_2D sampler2D
#define SAMPLE_INDEX 0
#endif
