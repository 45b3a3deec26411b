// No light at all: the base colour is shown as it is, by whoever adds the terms up.
#pragma needs(nothing)
ReflectedLight shade(Surface s, vec3 to_light) {
    return ReflectedLight(vec3(0.0), vec3(0.0));
}
