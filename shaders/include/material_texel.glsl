// Texel of a material's image at texture coordinates.
//
// Anisotropic filters read along the longer axis of a pixel's footprint. Samplers allow a ratio of 8 (`gpu_scene.py`),
// so a footprint of 8 images or more reads the coarsest mip level, which is a single texel. It is read here directly,
// because a software rasteriser would visit every repetition of the image in the footprint: thousands near a horizon,
// and any number beside a triangle, where coordinates are extrapolated. All four pixels of a quad take the same branch,
// because `texture` computes the footprint from the coordinates of all of them.
vec4 material_texel(sampler2D image, vec2 uv) {
    uv = clamp(uv, -65536.0, 65536.0);  // also replaces NaN
    vec2 size = vec2(textureSize(image, 0)), limit = 8.0 * max(size.x, size.y) / size;
    vec2 longer = max(abs(dFdxCoarse(uv)), abs(dFdyCoarse(uv)));  // some drivers return those of a row or a column
    float far = any(greaterThan(longer, limit)) ? 1.0 : 0.0;
    bool is_far = far + abs(dFdxFine(far)) + abs(dFdyFine(far)) > 0.0;
    vec4 texel = texture(image, is_far ? vec2(0.0) : uv);
    if (is_far) texel = texelFetch(image, ivec2(0), textureQueryLevels(image) - 1);
    return texel;
}
