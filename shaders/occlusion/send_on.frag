// What surfaces make of the light that reaches them from all sides.
uniform sampler2D indirect;  // irradiance over pi
uniform sampler2D albedo;    // root of the base colour
#ifdef HAS_MATERIAL
uniform sampler2D material;
#endif
#ifdef AMBIENT
uniform sampler2D occlusion;
uniform vec3 ambient;
#endif
out vec4 sent;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 base_color = texelFetch(albedo, texel, 0).rgb;
    base_color *= base_color;
    vec4 surface = vec4(0.0, 0.0, 1.0, 1.0);  // metallic, roughness, occlusion, lit
#ifdef HAS_MATERIAL
    surface = texelFetch(material, texel, 0);
#endif
    sent = vec4(texelFetch(indirect, texel, 0).rgb * base_color * (1.0 - surface.x) * surface.w, 1.0);
#ifdef AMBIENT
    sent.rgb += ambient * base_color * surface.z * surface.w * texelFetch(occlusion, texel, 0).r;
#endif
}
