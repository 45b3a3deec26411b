// AgX (Sobotka 2022) in the form that Blender ships (Chow 2023). Applied per channel of primaries inside Rec. 2020, so
// that bright saturated colours fade to white instead of clipping to a primary; middle grey stays at 0.18.
const mat3 agx_inset = mat3(0.544908137, 0.140440059, 0.088827412,  // from linear Rec. 709
                            0.373779460, 0.754109599, 0.178877125,
                            0.081384977, 0.105433585, 0.732250000);
const mat3 agx_outset = mat3(1.964550960, -0.299322434, -0.164368338,  // to linear Rec. 709
                             -0.855858451, 1.326451074, -0.238224641,
                             -0.108867108, -0.027084021, 1.402665347);

// A sigmoid over stops from 0 to 1, through (0, 0), the pivot and (1, 1), with the slope given at the pivot.
vec3 agx_sigmoid(vec3 stops) {
    const float slope = 2.4, power = 1.5;
    const vec2 pivot = vec2(10.0 / 16.5, 0.489437090);  // middle grey: 0.18^(1/2.4)
    // The height of each half, chosen so that the curve ends at 0 and at 1.
    const float toe = pow(pow(pivot.y, -power) - pow(slope * pivot.x, -power), -1.0 / power);
    const float shoulder =
        pow(pow(1.0 - pivot.y, -power) - pow(slope * (1.0 - pivot.x), -power), -1.0 / power);
    vec3 rise = slope * (stops - pivot.x);
    vec3 scale = mix(vec3(toe), vec3(shoulder), greaterThan(rise, vec3(0.0)));
    return pivot.y + rise / pow(1.0 + pow(abs(rise) / scale, vec3(power)), vec3(1.0 / power));
}

vec3 tone_curve(vec3 c) {
    const float darkest = -12.473931188, brightest = 4.026068812;  // log2(0.18) - 10 and + 6.5 stops
    vec3 stops = (log2(max(agx_inset * c, 1e-10)) - darkest) / (brightest - darkest);
    vec3 encoded = agx_sigmoid(clamp(stops, 0.0, 1.0));
    return max(agx_outset * pow(max(encoded, 0.0), vec3(2.4)), 0.0);
}
