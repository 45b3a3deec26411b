// The type of the values that occlusion passes compute and filter: ambient visibility (1 open, 0 closed), or with
// HAS_VECTOR a vec4 with visibility in w, and in xyz indirect light or the direction of the bent normal.
#ifdef HAS_VECTOR
#define Value vec4
#define VALUE_CHANNELS rgba
#ifdef WRITES_REFLECTIONS
const Value OPEN_VALUE = vec4(0.0);  // no confidence
#else
const Value OPEN_VALUE = vec4(0.0, 0.0, 0.0, 1.0);
#endif
#else
#define Value float
#define VALUE_CHANNELS r
const Value OPEN_VALUE = 1.0;
#endif

float ambient_visibility(Value value) {
#ifdef HAS_VECTOR
    return value.w;
#else
    return value;
#endif
}
