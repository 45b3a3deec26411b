// Indirect light from back faces, where a G-buffer of them is available.
uniform sampler2D back_surfaces;
uniform sampler2D back_diffuse;

// Light from the back face at a texel. `area` is that of the disc on the screen that the sample stands for, in square
// metres at the distance of the pixel, whose clip-space w is `w`.
vec3 back_face_light(
    View view, ivec2 sample_texel, vec3 position, vec4 surface, float w, float light_radius, float area
) {
    ivec2 size = textureSize(back_surfaces, 0);
    vec4 sample_surface = texelFetch(back_surfaces, sample_texel, 0);
    if (sample_surface.w == 0.0) return vec3(0.0);
    vec3 sample_position = view_position(view, texel_uv(sample_texel, size, screen_size), sample_surface.w);
    vec3 offset = sample_position - position;
    vec3 ray = view.projection[2][3] == 0.0 ? vec3(0.0, 0.0, -1.0) : sample_position / sample_surface.w;
    float sample_distance = length(offset);
    float cos_emitter = -dot(sample_surface.xyz, offset) / sample_distance;
    if (cos_emitter <= 0.0 || sample_distance > light_radius
        || !is_above_tangent_plane(view, offset, surface.xyz, max(surface.w, sample_surface.w))) return vec3(0.0);
    float scale = clip_w(view, sample_surface.w) / w;
    float disc_area = area * scale * scale / max(abs(dot(sample_surface.xyz, ray)), 0.05);
    vec3 radiance = texelFetch(back_diffuse, screen_texel(sample_texel, size, screen_size), 0).rgb;
    float cos_receiver = dot(surface.xyz, offset) / sample_distance;
    return radiance * disc_form_factor(sample_distance, disc_area / EMITTING_DISCS, cos_emitter, cos_receiver);
}
