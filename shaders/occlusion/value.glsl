// What a pass finds out for each pixel: how open it is, or with FOUR that in w and in xyz light or a direction.
#ifdef FOUR
#define Value vec4
#define PARTS rgba
const Value NOTHING = vec4(0.0, 0.0, 0.0, 1.0);
#else
#define Value float
#define PARTS r
const Value NOTHING = 1.0;
#endif

float openness(Value value) {
#ifdef FOUR
    return value.w;
#else
    return value;
#endif
}
