// Diffuse reflection of indirect light and, with AMBIENT, of ambient light.
uniform sampler2D indirect;  // irradiance over pi
uniform sampler2D albedo;    // square root of the base colour
#ifdef HAS_MATERIAL
uniform sampler2D material;
#endif
#ifdef AMBIENT
uniform sampler2D occlusion;
uniform vec3 ambient;
#endif
out vec4 reflected;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 base_color = texelFetch(albedo, texel, 0).rgb;
    base_color *= base_color;
    vec4 properties = vec4(0.0, 0.0, 1.0, 1.0);  // metallic, roughness, occlusion, 1 for lit surfaces
#ifdef HAS_MATERIAL
    properties = texelFetch(material, texel, 0);
#endif
    vec3 light = texelFetch(indirect, texel, 0).rgb;
    reflected = vec4(light * base_color * (1.0 - properties.x) * properties.w, 1.0);
#ifdef AMBIENT
    reflected.rgb += ambient * base_color * properties.z * properties.w * texelFetch(occlusion, texel, 0).r;
#endif
}
