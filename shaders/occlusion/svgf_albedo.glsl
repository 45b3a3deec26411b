// The reflectance that light is divided by before it is filtered, and multiplied by afterwards. Dark surfaces count as
// a little brighter, because the light that they reflect and emit is not proportional to their albedo.
vec3 filter_albedo(vec3 albedo) {
    return max(albedo, 0.05);
}
