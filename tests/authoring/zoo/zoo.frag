uniform samplerCube sky;
uniform sampler3D fog;
uniform sampler2DArray layers;
uniform sampler2DMS samples;
#ifdef HAS_MANY
uniform sampler2D many_0;
#endif
uniform sampler2DArrayShadow shadow_map;
uniform sampler2D depth;
uniform sampler2D before;
layout(std430) readonly buffer words { uint all_words[]; };
uniform float gain;
uniform vec3 tint;
in vec2 v_uv;
out vec4 result;
out float past;
void main() {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec3 position = world_position(depth_views[0], v_uv, texelFetch(depth, p, 0).r);
    result = gain * vec4(tint, 1.0) * texture(sky, vec3(v_uv, 1.0)) + texelFetch(layers, ivec3(p, 1), 0) + texelFetch(samples, p, 2);
    result.rgb += texture(shadow_map, vec4(v_uv, 0.0, 0.5)) + float(all_words[3]) + 0.01 * position;
    result.rgb *= weight(v_uv, 1) + texture(fog, vec3(v_uv, 0.5)).rgb;
#ifdef HAS_MANY
    result += texelFetch(many_0, p, 0);
#endif
    past = 0.5 * texelFetch(before, p, 0).r + result.r;
}
