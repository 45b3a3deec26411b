"""Mip levels of a float texture, each the exact mean of the one above.

A compute shader does it: Mesa's software rasteriser compiles its own program anew in each process, 0.1 to 0.15 s for
each format, but keeps those of its users on disk. Byte textures are left to the driver, which is faster at them from a
few million texels on.
"""

from __future__ import annotations

from rendergraph.gl.device import Device
from rendergraph.gl.textures import GpuTexture
from rendergraph.textures import FORMATS

_WRITE_ONLY, _FETCHED_OR_STORED = 0x88B9, 0x28

# Over an odd side of 2m + 1 texels each of the m below covers 2 + 1/m of them (Guthe and Heckbert 2005).
_TEXT = """#version 430
layout(local_size_x = 8, local_size_y = 8) in;
uniform sampler2D source;
uniform writeonly image2D level;
uniform int above;

vec3 weights(int index, int size) {
    if (size == 1) return vec3(1.0, 0.0, 0.0);
    if (size % 2 == 0) return vec3(0.5, 0.5, 0.0);
    return vec3(size / 2 - index, size / 2, index + 1) / float(size);
}

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = textureSize(source, above);
    if (any(greaterThanEqual(texel, imageSize(level)))) return;
    ivec2 taps = ivec2(size.x == 1 ? 1 : 2 + size.x % 2, size.y == 1 ? 1 : 2 + size.y % 2);
    vec3 across = weights(texel.x, size.x), down = weights(texel.y, size.y);
    vec4 mean = vec4(0.0);
    for (int y = 0; y < taps.y; ++y) {
        for (int x = 0; x < taps.x; ++x) {
            mean += across[x] * down[y] * texelFetch(source, 2 * texel + ivec2(x, y), above);
        }
    }
    imageStore(level, texel, mean);
}
"""


def fill_mips(device: Device, texture: GpuTexture) -> None:
    """Fill the levels of a 2D float texture from its first; uses texture and image unit 0."""
    if device.mips is None:
        device.mips = device.ctx.compute_shader(_TEXT)
    desc, raw, program = texture.desc, device.raw, device.mips
    image_format = FORMATS[desc.format].gl
    raw.glBindTextureUnit(0, texture.glo)
    raw.glBindSampler(0, 0)
    for level in range(1, desc.mips):
        program["above"] = level - 1
        raw.glMemoryBarrier(_FETCHED_OR_STORED)
        raw.glBindImageTexture(0, texture.glo, level, 0, 0, _WRITE_ONLY, image_format)
        width, height = desc.mip_size(level)
        program.run((width + 7) // 8, (height + 7) // 8)
    raw.glMemoryBarrier(_FETCHED_OR_STORED)
    raw.glBindTextureUnit(0, 0)
    raw.glBindImageTexture(0, 0, 0, 0, 0, _WRITE_ONLY, image_format)
