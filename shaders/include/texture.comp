// Evaluates a kind of generated texture, `#include <TEXTURE>`: first base colour, then normals with height, and
// occlusion, roughness and metallic. Each texel is the mean of several points, so that edges are smooth.
#include <srgb.glsl>
#include <TEXTURE>
layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba8, binding = 0) uniform writeonly image2D colors;
layout(rgba32f, binding = 1) uniform image2D fields;  // height, roughness, metallic
layout(rgba8, binding = 2) uniform writeonly image2D normals;
layout(rgba8, binding = 3) uniform writeonly image2D surfaces;
uniform int phase;
uniform int points;  // along each side of a texel

ivec2 size;

float height_at(ivec2 texel) {
    return imageLoad(fields, wrapped(texel, size)).r;
}

void sample_texel(ivec2 texel) {
    vec4 color = vec4(0.0);
    vec3 field = vec3(0.0);
    for (int i = 0; i < points * points; ++i) {
        vec2 at = (vec2(texel) + (vec2(i % points, i / points) + 0.5) / float(points)) / vec2(size);
        TextureSample s = texture_sample(at);
        color += vec4(s.color * s.alpha, s.alpha);
        field += vec3(s.height, s.roughness, s.metallic);
    }
    float count = float(points * points);
    vec3 mean = color.a > 0.0 ? color.rgb / color.a : texture_sample((vec2(texel) + 0.5) / vec2(size)).color;
    imageStore(colors, texel, vec4(linear_to_srgb(clamp(mean, 0.0, 1.0)), color.a / count));
    imageStore(fields, texel, vec4(field / count, 0.0));
}

// The share of the sky's cosine-weighted light that is not hidden by heights around a texel: along each of 8 directions
// the highest horizon h hides sin² h of it.
float open_sky(ivec2 texel, float height) {
    float open = 0.0;
    for (int direction = 0; direction < 8; ++direction) {
        vec2 along = vec2(cos(0.7853982 * float(direction)), sin(0.7853982 * float(direction)));
        float slope = 0.0;
        for (float away = 1.0; away < 0.04 * float(size.x); away *= 1.7) {
            vec2 step_to = round(along * away);
            slope = max(slope, (height_at(texel + ivec2(step_to)) - height) * float(size.x) / length(step_to));
        }
        open += 1.0 / (8.0 * (1.0 + slope * slope));
    }
    return open;
}

void main() {
    size = imageSize(colors);
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, size))) return;
    if (phase == 0) {
        sample_texel(texel);
        return;
    }
    vec4 field = imageLoad(fields, texel);
    vec2 slope = vec2(height_at(texel + ivec2(1, 0)) - height_at(texel - ivec2(1, 0)),
                      height_at(texel + ivec2(0, 1)) - height_at(texel - ivec2(0, 1))) * 0.5 * vec2(size);
    vec3 normal = normalize(vec3(-slope.x, slope.y, 1.0));  // green is up, and v runs down
    imageStore(normals, texel, vec4(normal * 0.5 + 0.5, clamp(0.5 + field.r * 8.0, 0.0, 1.0)));
    imageStore(surfaces, texel, vec4(open_sky(texel, field.r), field.gb, 1.0));
}
