// The other side of things, where a picture of back faces has it.
uniform sampler2D back_surfaces;
uniform sampler2D back_diffuse;

// Light of the far side of what is seen, which is at most in the region: `share` is its part of the disc.
vec3 light_from_behind(View v, ivec2 there, vec3 position, vec4 here, float w, float region, float share) {
    ivec2 size = textureSize(back_surfaces, 0);
    vec4 seen = texelFetch(back_surfaces, there, 0);
    if (seen.w == 0.0) return vec3(0.0);
    vec3 at = view_position(v, place_for(there, size, screen), seen.w);
    vec3 offset = at - position;
    vec3 sight = v.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : at / seen.w;
    float apart = length(offset);
    float facing = -dot(seen.xyz, offset) / apart;
    if (facing <= 0.0 || apart > region || !rises(v, offset, here.xyz, max(here.w, seen.w))) return vec3(0.0);
    float scale = clip_w(v, seen.w) / w;
    float area = share * scale * scale / max(abs(dot(seen.xyz, sight)), 0.05);
    vec3 sent = texelFetch(back_diffuse, texel_for(there, size, screen), 0).rgb;
    return sent * disc_form_factor(apart, area / SENDING_DISCS, facing, dot(here.xyz, offset) / apart);
}
