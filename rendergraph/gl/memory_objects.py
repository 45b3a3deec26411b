"""Blocks of memory shared by textures of any description (GL_EXT_memory_object_fd).

Textures in a block overwrite each other: one may be written only when no command that uses another is running. OpenGL
imports the memory as a file descriptor; Vulkan 1.1 allocates and exports it. Its structures are packed by hand, as each
is used once.
"""

from __future__ import annotations

import ctypes
import os
import struct
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from ctypes import addressof
from functools import reduce
from operator import and_
from typing import Any

from msgspec import Struct, field

from rendergraph.errors import Problem, RenderError
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.gl.textures import GpuTexture
from rendergraph.textures import FORMATS, TextureDesc

_DEVICE_UUID, _HANDLE_TYPE_OPAQUE_FD = 0x9597, 0x9586


class MemoryBlock(Struct, eq=False):
    """A memory object with its textures, by description."""

    device: Device
    glo: int
    textures: dict[TextureDesc, GpuTexture] = field(default_factory=dict)

    def release(self) -> None:
        for texture in self.textures.values():
            textures.delete(self.device, texture)
        self.textures.clear()
        self.device.raw.delete("glDeleteMemoryObjectsEXT", self.glo)


def make_blocks(device: Device, groups: Sequence[Sequence[TextureDesc]]) -> list[MemoryBlock]:
    """Return a block for each list of descriptions, as large as its largest texture is on this device."""
    blocks: list[MemoryBlock] = []
    allocated: list[tuple[int, int]] = []  # bytes and file descriptors that have not been imported
    if not groups:
        return blocks
    try:
        if "GL_EXT_memory_object_fd" not in device.ctx.extensions:
            raise NoMemoryObjects("the driver has no GL_EXT_memory_object_fd")
        identity = (ctypes.c_ubyte * 16)()
        device.raw.glGetUnsignedBytei_vEXT(_DEVICE_UUID, 0, identity)
        with ThreadPoolExecutor(1) as pool:  # NVIDIA's Vulkan leaves its thread without a current OpenGL context
            pool.submit(_allocate, bytes(identity), groups, allocated).result()
        for descs in groups:
            blocks.append(_block(device, descs, *allocated.pop(0)))
    except BaseException as error:
        for _, descriptor in allocated:
            os.close(descriptor)
        for block in blocks:
            block.release()
        if isinstance(error, NoMemoryObjects):
            text = f"no memory objects on {device.renderer}: {error}; leave out --heap"
            raise RenderError(Problem("RG621", text)) from None
        raise
    return blocks


def _allocate(identity: bytes, groups: Sequence[Sequence[TextureDesc]], allocated: list[tuple[int, int]]) -> None:
    """Append the bytes and the file descriptor of a block for each list of descriptions."""
    with open_vulkan(identity) as vulkan:
        for descs in groups:
            sizes, masks = zip(*map(vulkan.requirements, descs), strict=True)
            types = reduce(and_, masks)
            if not types:
                raise NoMemoryObjects("no memory type fits all textures of a block")
            allocated.append((max(sizes), vulkan.export(max(sizes), types)))


def _block(device: Device, descs: Sequence[TextureDesc], size: int, descriptor: int) -> MemoryBlock:
    block = MemoryBlock(device, device.raw.make("glCreateMemoryObjectsEXT"))
    try:  # the driver owns the descriptor from then on
        device.raw.glImportMemoryFdEXT(block.glo, size, _HANDLE_TYPE_OPAQUE_FD, descriptor)
        for desc in dict.fromkeys(descs):
            block.textures[desc] = textures.create(device, desc, "a texture of a block", memory=block.glo)
    except BaseException:
        block.release()
        raise
    return block


_FORMATS = {
    "r8": 9, "rg8": 16, "rgba8": 37, "srgb8_a8": 43, "r16": 70, "rg16": 77, "rgba16": 91, "rgb10_a2": 64,
    "rgba16_snorm": 92, "r16f": 76, "rg16f": 83, "rgba16f": 97, "r11f_g11f_b10f": 122, "r32f": 100, "rg32f": 103,
    "rgba32f": 109, "r8ui": 13, "rg8ui": 20, "rgba8ui": 41, "r16ui": 74, "rg16ui": 81, "rgba16ui": 95, "r32ui": 98,
    "rg32ui": 101, "rgba32ui": 107, "r32i": 99, "rg32i": 102, "rgba32i": 108,
    "depth16": 124, "depth32f": 126, "depth24_stencil8": 129, "depth32f_stencil8": 130,
}  # fmt: skip
_OPAQUE_FD = 1
_COLOR_USES, _DEPTH_USES = 0x1 | 0x2 | 0x4 | 0x10, 0x1 | 0x2 | 0x4 | 0x20


class NoMemoryObjects(Exception):
    """Vulkan is missing, or does not offer the device that OpenGL uses."""


class Vulkan:
    """A Vulkan device, open while memory is allocated from it."""

    def __init__(self, library: Any, physical: Any, device: Any) -> None:
        self._library, self._physical, self._device = library, physical, device

    def requirements(self, desc: TextureDesc) -> tuple[int, int]:
        """Return the bytes of a texture on this device and a mask of the memory types that fit it."""
        uses = _DEPTH_USES if FORMATS[desc.format].is_depth else _COLOR_USES
        external = _packed("@I P I", 1000072001, 0, _OPAQUE_FD)
        flags = 0x10 if desc.kind == "texture_cube" else 0
        kind, depth, layers = (2, desc.layers, 1) if desc.kind == "texture3d" else (1, 1, desc.layers)
        size = (desc.width, desc.height, depth, desc.mips, layers)
        asked = (14, addressof(external), flags, kind, _FORMATS[desc.format], *size, desc.samples, 0, uses, 0, 0, 0, 0)
        image, found = ctypes.c_uint64(), (ctypes.c_uint64 * 3)()
        _call(self._library, "vkCreateImage", self._device, _packed("@I P 13I P I", *asked), None, ctypes.byref(image))
        self._library.vkGetImageMemoryRequirements(self._device, image, found)
        self._library.vkDestroyImage(self._device, image, None)
        return found[0], found[2] & 0xFFFFFFFF

    def export(self, size: int, types: int) -> int:
        """Return a file descriptor of new memory of a type in the mask, device-local if possible."""
        table = (ctypes.c_uint32 * 256)()
        self._library.vkGetPhysicalDeviceMemoryProperties(self._physical, table)
        able = [number for number in range(table[0]) if types >> number & 1]
        chosen = next((number for number in able if table[1 + 2 * number] & 1), able[0])
        exported = _packed("@I P I", 1000072002, 0, _OPAQUE_FD)
        memory, descriptor = ctypes.c_uint64(), ctypes.c_int(-1)
        asked = _packed("@I P Q I", 5, addressof(exported), size, chosen)
        _call(self._library, "vkAllocateMemory", self._device, asked, None, ctypes.byref(memory))
        self._library.vkGetDeviceProcAddr.restype = ctypes.c_void_p
        address = self._library.vkGetDeviceProcAddr(self._device, b"vkGetMemoryFdKHR")
        get = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)(address)
        asked = _packed("@I P Q I", 1000074002, 0, memory.value, _OPAQUE_FD)
        result = get(self._device, addressof(asked), addressof(descriptor))
        self._library.vkFreeMemory(self._device, memory, None)  # the descriptor keeps the memory
        if result:
            raise NoMemoryObjects(f"vkGetMemoryFdKHR failed ({result})")
        return descriptor.value


@contextmanager
def open_vulkan(identity: bytes) -> Iterator[Vulkan]:
    """Open the device with this 16-byte identity, which OpenGL reports for its own."""
    try:
        library = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        raise NoMemoryObjects("libvulkan.so.1 cannot be loaded") from None
    instance, device = ctypes.c_void_p(), ctypes.c_void_p()
    application = _packed("@I P P I P I I", 0, 0, 0, 0, 0, 0, 1 << 22 | 1 << 12)
    with _no_layer():
        asked = _packed("@I P I P I P I P", 1, 0, 0, addressof(application), 0, 0, 0, 0)
        _call(library, "vkCreateInstance", asked, None, ctypes.byref(instance))
    try:
        physical = _same_device(library, instance, identity)
        priority = ctypes.c_float(1.0)
        queue = _packed("@I P I I I P", 2, 0, 0, 0, 1, addressof(priority))
        names = (ctypes.c_char_p * 1)(b"VK_KHR_external_memory_fd")
        asked = _packed("@I P I I P I P I P P", 3, 0, 0, 1, addressof(queue), 0, 0, 1, addressof(names), 0)
        _call(library, "vkCreateDevice", physical, asked, None, ctypes.byref(device))
        try:
            yield Vulkan(library, physical, device)
        finally:
            library.vkDestroyDevice(device, None)
    finally:
        library.vkDestroyInstance(instance, None)


def _same_device(library: Any, instance: Any, identity: bytes) -> Any:
    count = ctypes.c_uint32()
    library.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    devices = (ctypes.c_void_p * count.value)()
    library.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), devices)
    for handle in devices:
        names = ctypes.create_string_buffer(struct.pack("@I P", 1000071004, 0), 80)
        properties = ctypes.create_string_buffer(struct.pack("@I P", 1000059001, addressof(names)), 2048)
        library.vkGetPhysicalDeviceProperties2(ctypes.c_void_p(handle), properties)
        if names.raw[16:32] == identity:
            return ctypes.c_void_p(handle)
    raise NoMemoryObjects("Vulkan does not offer the device that OpenGL uses")


@contextmanager
def _no_layer() -> Iterator[None]:
    """Disable Mesa's layer that orders devices: it looks for a display, and complains if there is none."""
    before = os.environ.get("NODEVICE_SELECT")
    os.environ["NODEVICE_SELECT"] = "1"
    try:
        yield
    finally:
        del os.environ["NODEVICE_SELECT"]
        if before is not None:
            os.environ["NODEVICE_SELECT"] = before


def _packed(form: str, *values: int) -> Any:
    return ctypes.create_string_buffer(struct.pack(form, *values))


def _call(library: Any, name: str, *arguments: Any) -> None:
    if result := getattr(library, name)(*arguments):
        raise NoMemoryObjects(f"{name} failed ({result})")
