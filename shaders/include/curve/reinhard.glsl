// E. Reinhard, M. Stark, P. Shirley and J. Ferwerda, "Photographic Tone Reproduction for Digital Images", 2002:
// x/(1+x), per channel.
vec3 tone_curve(vec3 c) {
    return c / (1.0 + c);
}
