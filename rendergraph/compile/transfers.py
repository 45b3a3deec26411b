"""What the device does without a program: clears, mip chains, copies; and images bound for compute shaders."""

from __future__ import annotations

from functools import partial

from rendergraph.compile.executable import Call
from rendergraph.compile.memory import Memory
from rendergraph.gl.device import Device
from rendergraph.gl.textures import Clear
from rendergraph.steps import Read, Step, Write
from rendergraph.textures import FORMATS, BufferDesc

_R8UI, _RED_INTEGER, _UNSIGNED_BYTE, _READ_WRITE = 0x8232, 0x8D94, 0x1401, 0x88BA


def transfer_calls(device: Device, memory: Memory, step: Step, parity: int) -> list[Call]:
    """The calls of a clear, a mip chain or a copy."""
    if step.kind == "copy":
        return _copy(device, memory, step, parity)
    if step.kind == "mipmaps":
        textures = [memory.texture(write.resource, parity) for write in step.writes]
        return [partial(device.raw.glGenerateTextureMipmap, texture.glo) for texture in textures]
    return [
        clear_buffer(device, memory, write) if write.use == "buffer" else _clear(device, memory, write, parity)
        for write in step.writes
    ]


def clear_buffer(device: Device, memory: Memory, write: Write) -> Call:
    """Zeros by the device itself: moderngl's clear maps the buffer, and so waits for whoever still reads it."""
    glo = memory.buffer(write.resource).glo
    return partial(device.raw.glClearNamedBufferData, glo, _R8UI, _RED_INTEGER, _UNSIGNED_BYTE, None)


def image_calls(device: Device, memory: Memory, step: Step, parity: int) -> tuple[list[Call], dict[str, int]]:
    """The calls that bind and clear the images of a compute step, and the image unit of each name."""
    images: list[Read | Write] = [read for read in step.reads if read.use == "image"]
    images += [write for write in step.writes if write.use == "image"]
    calls: list[Call] = []
    for unit, touched in enumerate(images):
        previous = isinstance(touched, Read) and touched.previous
        texture = memory.texture(touched.resource, parity, previous=previous)
        layered = touched.layer is None and texture.desc.kind != "texture2d"
        calls.append(
            partial(
                device.raw.glBindImageTexture,
                unit,
                texture.glo,
                touched.mip or 0,
                int(layered),
                touched.layer or 0,
                _READ_WRITE,
                FORMATS[texture.desc.format].gl,
            )
        )
    written = [write for write in step.writes if write.use == "image" and write.load == "clear"]
    calls += [_clear(device, memory, write, parity) for write in written]
    return calls, {touched.name: unit for unit, touched in enumerate(images)}


def _clear(device: Device, memory: Memory, write: Write, parity: int) -> Call:
    texture = memory.texture(write.resource, parity)
    return Clear(device, texture, write.clear, mip=write.mip, layer=write.layer)


def _copy(device: Device, memory: Memory, step: Step, parity: int) -> list[Call]:
    (read,), (write,) = step.reads, step.writes
    if isinstance(memory.plan.resources[read.resource].desc, BufferDesc):
        return [partial(device.ctx.copy_buffer, memory.buffer(write.resource), memory.buffer(read.resource))]
    source, target = memory.texture(read.resource, parity), memory.texture(write.resource, parity)
    return [
        partial(
            device.raw.glCopyImageSubData,
            source.glo,
            source.target,
            mip,
            0,
            0,
            0,
            target.glo,
            target.target,
            mip,
            0,
            0,
            0,
            *source.desc.mip_size(mip),
            source.desc.layers,
        )
        for mip in range(source.desc.mips)
    ]
