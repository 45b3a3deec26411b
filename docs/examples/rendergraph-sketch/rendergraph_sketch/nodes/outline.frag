// Edges from depth and normals: each texel against its neighbours on a circle as wide as the line.
uniform sampler2D radiance;  // scene-linear
uniform sampler2D depth;     // window depth
uniform sampler2D normal;    // world space, 0 where nothing is
uniform float width;         // texels
uniform float gap;           // of the distance
uniform float crease;        // degrees
uniform vec3 ink;            // scene-linear
out vec4 inked;

const int NEIGHBOURS = 8;

vec3 position_at(ivec2 texel) {
    vec2 uv = (vec2(texel) + 0.5) * depth_views[0].viewport.zw;
    return world_position(depth_views[0], uv, texelFetch(depth, texel, 0).r);
}

bool is_edge(ivec2 here, ivec2 there) {
    vec3 n = texelFetch(normal, here, 0).xyz, other = texelFetch(normal, there, 0).xyz;
    if (n == vec3(0.0) || other == vec3(0.0)) return n != other;  // the surface ends
    vec3 position = position_at(here);
    float off = abs(dot(normalize(n), position_at(there) - position));
    bool jumps = off > gap * distance(position, depth_views[0].eye.xyz);
    return jumps || dot(normalize(n), normalize(other)) < cos(radians(crease));
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy), last = textureSize(depth, 0) - 1;
    float reach = max(0.5 * width, 0.75), edges = 0.0;
    for (int i = 0; i < NEIGHBOURS; ++i) {
        float angle = radians(360.0) * float(i) / float(NEIGHBOURS);
        ivec2 there = clamp(here + ivec2(round(reach * vec2(cos(angle), sin(angle)))), ivec2(0), last);
        edges += float(is_edge(here, there));
    }
    vec4 seen = texelFetch(radiance, here, 0);
    float covered = min(edges / 3.0, 1.0);  // three of eight lie beyond a straight edge
    inked = mix(seen, vec4(ink, 1.0), covered);
}
