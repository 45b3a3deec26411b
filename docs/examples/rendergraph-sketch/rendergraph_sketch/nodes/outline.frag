// Detects edges in depth and normals, by comparing each texel with its neighbours on a circle as wide as the line.
uniform sampler2D radiance;  // scene-linear
uniform sampler2D depth;     // window depth
uniform sampler2D normal;    // world space, 0 on the background
uniform float width;         // texels
uniform float gap;           // fraction of the distance
uniform float crease;        // degrees
uniform vec3 ink;            // scene-linear
out vec4 inked;

const int NEIGHBOURS = 8;

vec3 position_at(ivec2 texel) {
    vec2 uv = (vec2(texel) + 0.5) * depth_views[0].viewport.zw;
    return world_position(depth_views[0], uv, texelFetch(depth, texel, 0).r);
}

bool is_edge(ivec2 texel, ivec2 neighbour) {
    vec3 n = texelFetch(normal, texel, 0).xyz, neighbour_n = texelFetch(normal, neighbour, 0).xyz;
    if (n == vec3(0.0) || neighbour_n == vec3(0.0)) return n != neighbour_n;  // the surface ends
    vec3 position = position_at(texel);
    float plane_distance = abs(dot(normalize(n), position_at(neighbour) - position));
    bool is_gap = plane_distance > gap * distance(position, depth_views[0].eye.xyz);
    return is_gap || dot(normalize(n), normalize(neighbour_n)) < cos(radians(crease));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy), last = textureSize(depth, 0) - 1;
    float radius = max(0.5 * width, 0.75), edges = 0.0;
    for (int i = 0; i < NEIGHBOURS; ++i) {
        float angle = radians(360.0) * float(i) / float(NEIGHBOURS);
        ivec2 neighbour = clamp(texel + ivec2(round(radius * vec2(cos(angle), sin(angle)))), ivec2(0), last);
        edges += float(is_edge(texel, neighbour));
    }
    vec4 source = texelFetch(radiance, texel, 0);
    float coverage = min(edges / 3.0, 1.0);  // three of eight neighbours lie beyond a straight edge
    inked = mix(source, vec4(ink, 1.0), coverage);
}
