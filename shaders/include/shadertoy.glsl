// The names that Shadertoy gives to programs with a `mainImage`; rendergraph includes it before such a file.
#define time shadertoy_time
#define delta_time shadertoy_delta_time
#include <frame.glsl>
#undef time
#undef delta_time
#define iResolution vec3(camera.viewport.xy, 1.0)
#define iTime shadertoy_time
#define iTimeDelta shadertoy_delta_time
#define iFrame (frame_index - 1)
#define iFrameRate (1.0 / max(shadertoy_delta_time, 1e-6))
#define iDate vec4(0.0)
#define iSampleRate 44100.0
const float iChannelTime[4] = float[4](0.0, 0.0, 0.0, 0.0);
