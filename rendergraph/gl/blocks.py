"""Blocks of memory that textures of any description lie in (GL_EXT_memory_object_fd).

Textures in a block overwrite each other: one may be written where no command that touches another is under way.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

from msgspec import Struct, field

from rendergraph.errors import Problem, RenderError
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.gl.textures import GpuTexture
from rendergraph.gl.vulkan import NoMemoryObjects, Vulkan, open_vulkan
from rendergraph.textures import TextureDesc

_DEVICE_UUID, _HANDLE_TYPE_OPAQUE_FD = 0x9597, 0x9586


class Block(Struct, eq=False):
    """A memory object with its textures, by description."""

    device: Device
    glo: int
    textures: dict[TextureDesc, GpuTexture] = field(default_factory=dict)

    def release(self) -> None:
        """Free the textures and the memory."""
        for texture in self.textures.values():
            textures.delete(self.device, texture)
        self.textures.clear()
        self.device.raw.delete("glDeleteMemoryObjectsEXT", self.glo)


def make_blocks(device: Device, wanted: Sequence[Sequence[TextureDesc]]) -> list[Block]:
    """A block for each list of descriptions, as large as its largest texture is on this device.

    Raises:
        RenderError: the driver has no memory objects, there is no Vulkan for the device, or too little memory.
    """
    made: list[Block] = []
    if not wanted:
        return made
    try:
        if "GL_EXT_memory_object_fd" not in device.ctx.extensions:
            raise NoMemoryObjects("the driver has no GL_EXT_memory_object_fd")
        identity = (ctypes.c_ubyte * 16)()
        device.raw.glGetUnsignedBytei_vEXT(_DEVICE_UUID, 0, identity)
        with open_vulkan(bytes(identity)) as vulkan:
            for descs in wanted:
                made.append(_block(device, vulkan, descs))
    except BaseException as error:
        for block in made:
            block.release()
        if isinstance(error, NoMemoryObjects):
            text = f"no memory objects on {device.renderer}: {error}; leave out --heap"
            raise RenderError(Problem("RG621", text)) from None
        raise
    return made


def _block(device: Device, vulkan: Vulkan, descs: Sequence[TextureDesc]) -> Block:
    sizes, masks = zip(*map(vulkan.requirements, descs), strict=True)
    types = masks[0]
    for mask in masks:
        types &= mask
    if not types:
        raise NoMemoryObjects("no type of memory takes all textures of a block")
    block = Block(device, device.raw.make("glCreateMemoryObjectsEXT"))
    try:  # the driver owns the descriptor from then on
        device.raw.glImportMemoryFdEXT(block.glo, max(sizes), _HANDLE_TYPE_OPAQUE_FD, vulkan.export(max(sizes), types))
        for desc in dict.fromkeys(descs):
            block.textures[desc] = textures.create(device, desc, "a texture of a block", memory=block.glo)
    except BaseException:
        block.release()
        raise
    return block
