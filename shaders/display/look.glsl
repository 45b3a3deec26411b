// A look: colours through a table with linear interpolation. A table of colours is interpolated within the tetrahedron
// of four entries around a colour, which keeps greys grey (J. Kasson et al., 1995).
#ifdef LOOK_CURVE
uniform sampler2D look_curve;   // (n, 1): a curve for each channel
#else
uniform sampler3D look_table;   // red along x, green along y, blue along z
#endif
uniform vec3 look_low, look_high;  // colours of the first and the last entry

#ifdef LOOK_CURVE
vec3 through_table(vec3 color) {
    int last = textureSize(look_curve, 0).x - 1;
    vec3 at = clamp((color - look_low) / (look_high - look_low), 0.0, 1.0) * float(last), result;
    for (int c = 0; c < 3; ++c) {
        int lower = min(int(at[c]), last - 1);
        float below = texelFetch(look_curve, ivec2(lower, 0), 0)[c];
        result[c] = mix(below, texelFetch(look_curve, ivec2(lower + 1, 0), 0)[c], at[c] - float(lower));
    }
    return result;
}
#else
vec3 through_table(vec3 color) {
    int last = textureSize(look_table, 0).x - 1;
    vec3 at = clamp((color - look_low) / (look_high - look_low), 0.0, 1.0) * float(last);
    ivec3 lower = min(ivec3(at), ivec3(last - 1));
    vec3 f = at - vec3(lower);
    // From the lower corner along the axis of the greatest fraction, then along the next one.
    ivec3 first = f.r >= f.g ? (f.r >= f.b ? ivec3(1, 0, 0) : ivec3(0, 0, 1))
                             : (f.g >= f.b ? ivec3(0, 1, 0) : ivec3(0, 0, 1));
    ivec3 final = f.r < f.g ? (f.r < f.b ? ivec3(1, 0, 0) : ivec3(0, 0, 1))
                            : (f.g < f.b ? ivec3(0, 1, 0) : ivec3(0, 0, 1));
    float greatest = max(max(f.r, f.g), f.b), least = min(min(f.r, f.g), f.b);
    float middle = f.r + f.g + f.b - greatest - least;
    vec3 sum = texelFetch(look_table, lower, 0).rgb * (1.0 - greatest);
    sum += texelFetch(look_table, lower + first, 0).rgb * (greatest - middle);
    sum += texelFetch(look_table, lower + 1 - final, 0).rgb * (middle - least);
    return sum + texelFetch(look_table, lower + 1, 0).rgb * least;
}
#endif

const float LOOK_DARKEST = 1.0 / 1024.0, LOOK_RANGE = 17.0;  // as in `_look.py`

vec3 linear_look(vec3 light) {
    vec3 encoded = log2(max(light, 0.0) / LOOK_DARKEST + 1.0) / LOOK_RANGE;
    return LOOK_DARKEST * (exp2(through_table(encoded) * LOOK_RANGE) - 1.0);
}
