// One level of a prefiltered cube map: what `environment_specular.comp` samples, summed over all of the picture. The
// picture is taken in cells of a cube, the smaller the steeper the lobe is there, and each cell shines from where its
// light is: a sun stays where it stands, so that cells may be much larger than it.
#include <brdf.glsl>
#include <cube.glsl>
layout(local_size_x = 8, local_size_y = 8) in;

uniform samplerCube cube;     // the environment, with all its levels
uniform samplerCube leaning;  // directions weighted by luminance, likewise
uniform float roughness;      // perceptual
uniform writeonly imageCube specular;

const int COARSE = 4;         // cells along a side of a face where the lobe is flat
const float STEEPNESS = 0.45;  // a cell's side over the angle in which the lobe falls

// GGX's lobe around a normal, seen along it, times N.L, for a given part of a face in place of solid angle.
float lobe(vec3 normal, vec3 light, float alpha) {
    float n_l = max(dot(normal, light), 0.0);
    vec3 size = abs(light);
    float major = max(size.x, max(size.y, size.z));
    return distribution_ggx(sqrt(0.5 + 0.5 * n_l), alpha) * n_l * major * major * major;
}

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int side = imageSize(specular).x;
    vec3 normal = cube_direction(texel.z, cube_place(texel.xy, side));
    float alpha = roughness * roughness;
    int finest = textureSize(cube, 0).x, splits = max(int(round(log2(float(finest) / float(COARSE)))), 0);
    int least = min(roughness < 0.45 ? 0 : 1, splits);  // levels of wide lobes have few texels, which may take longer
    vec3 sum = vec3(0.0);
    float weights = 0.0;
    for (int i = 0; i < 6 * COARSE * COARSE; ++i) {
        int face = i / (COARSE * COARSE);
        ivec2 cell = ivec2(i % COARSE, i / COARSE % COARSE);
        float cosine = dot(normal, cube_direction(face, cube_place(cell, COARSE)));
        float width = 0.5 * PI / float(COARSE);
        if (cosine < -0.75 * width) continue;  // below the horizon
        // Of the half vector, at the cell's nearest point; the lobe falls within sqrt(alpha^2 + angle^2).
        float angle = max(0.5 * (acos(clamp(cosine, -1.0, 1.0)) - 0.75 * width), 0.0);
        float wanted = width / (2.0 * STEEPNESS * sqrt(alpha * alpha + angle * angle));
        int split = clamp(int(ceil(log2(wanted))), least, splits), parts = 1 << split;
        int cells = COARSE * parts;
        float level = log2(float(finest) / float(cells));
        for (int k = 0; k < parts * parts; ++k) {
            vec3 middle = cube_direction(face, cube_place(cell * parts + ivec2(k % parts, k / parts), cells));
            vec3 light = normalize(textureLod(leaning, middle, level).xyz);
            weights += lobe(normal, middle, alpha) / float(cells * cells);
            sum += textureLod(cube, middle, level).rgb * (lobe(normal, light, alpha) / float(cells * cells));
        }
    }
    if (all(lessThan(texel.xy, ivec2(side)))) imageStore(specular, texel, vec4(sum / weights, 1.0));
}
