// Radiance seen through the air between the viewer and a position. The in-scattered radiance counts as ambient light.
#ifdef HAS_AIR
// `radiance` that leaves a position, as it arrives at the viewer: attenuated by the air, plus the light it scatters in.
// Unchanged where no `air` is connected.
vec3 through_air(vec3 position, vec3 radiance) {
    vec4 air = air_at(position);
    radiance *= air.a;
#if TERMS == TERMS_ALL || TERMS == TERMS_AMBIENT
    radiance += air.rgb;
#endif
    return min(radiance, 65504.0);  // the largest half float
}

// The same `radiance` without in-scattered light, for light that is added to a picture.
vec3 attenuated(vec3 position, vec3 radiance) {
    return radiance * air_at(position).a;
}
#else
vec3 through_air(vec3 position, vec3 radiance) {
    return radiance;
}

vec3 attenuated(vec3 position, vec3 radiance) {
    return radiance;
}
#endif
