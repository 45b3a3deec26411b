// Texel of a material's image at texture coordinates.
//
// Anisotropic filters read along the longer axis of a pixel's footprint. Samplers allow a ratio of 8 (`gpu_scene.py`),
// so a footprint of 8 images or more reads the coarsest mip level, which is a single texel. That is read here at once:
// a software rasteriser visits every repetition of the image in the footprint, thousands of them near a horizon.
vec4 material_texel(sampler2D image, vec2 uv) {
    int coarsest = textureQueryLevels(image) - 1;
    vec2 size = vec2(textureSize(image, 0)), dx = dFdxCoarse(uv) * size, dy = dFdyCoarse(uv) * size;
    float footprint = max(dot(dx, dx), dot(dy, dy)), limit = 8.0 * max(size.x, size.y);
    bool is_far = coarsest > 0 && !(footprint < limit * limit);  // or not finite, beside a triangle
    vec4 texel = texture(image, is_far ? vec2(0.0) : uv);
    if (is_far) {
        texel = texelFetch(image, ivec2(0), coarsest);
    }
    return texel;
}
