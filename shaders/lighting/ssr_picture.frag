// The picture that is reflected, without highlights of the lights: an eye behind the mirror sees those at other places.
uniform sampler2D radiance;
#ifdef HAS_DIRECT_SPECULAR
uniform sampler2D direct_specular;
#endif
out vec4 lit;

void main() {
    lit = texelFetch(radiance, ivec2(gl_FragCoord.xy), 0);
#ifdef HAS_DIRECT_SPECULAR
    lit.rgb = max(lit.rgb - texelFetch(direct_specular, ivec2(gl_FragCoord.xy), 0).rgb, 0.0);
#endif
}
