// No lighting: the surface shows its base colour, which `unlit_radiance` returns.
#pragma needs(nothing)
ReflectedLight shade(Surface s, vec3 light_dir) {
    return ReflectedLight(vec3(0.0), vec3(0.0));
}
