"""Operations without a program: clears, mip chains, copies; and image bindings of compute shaders."""

from __future__ import annotations

from functools import partial

from msgspec.structs import replace

from rendergraph.compile.memory import Call, Memory
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.steps import Read, Step, Write
from rendergraph.textures import FORMATS, BufferDesc

_COLOR, _NEAREST = 0x4000, 0x2600
_R8UI, _RED_INTEGER, _UNSIGNED_BYTE, _READ_WRITE = 0x8232, 0x8D94, 0x1401, 0x88BA


def transfer_calls(device: Device, memory: Memory, step: Step, parity: int) -> list[Call]:
    if step.kind == "copy":
        return _copy(device, memory, step, parity)
    if step.kind == "resolve":
        return _resolve(device, memory, step, parity)
    if step.kind == "mipmaps":
        textures = [memory.texture(write.resource, parity) for write in step.writes]
        return [partial(device.raw.glGenerateTextureMipmap, texture.glo) for texture in textures]
    calls: list[Call] = []
    for write in step.writes:
        calls += (
            [clear_buffer(device, memory, write, parity)] if write.use == "buffer" else _clear(memory, write, parity)
        )
    return calls


def clear_buffer(device: Device, memory: Memory, write: Write, parity: int) -> Call:
    """Return a call that clears a buffer on the device: moderngl's clear maps the buffer, and so waits for readers."""
    glo = memory.buffer(write.resource, parity).glo
    return partial(device.raw.glClearNamedBufferData, glo, _R8UI, _RED_INTEGER, _UNSIGNED_BYTE, None)


def image_calls(device: Device, memory: Memory, step: Step, parity: int) -> tuple[list[Call], dict[str, int]]:
    """Return the calls that bind and clear the images of a compute step, and the image unit of each name."""
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
    for write in step.writes:
        if write.use == "image" and write.load == "clear":
            calls += _clear(memory, write, parity)
    return calls, {touched.name: unit for unit, touched in enumerate(images)}


def _clear(memory: Memory, write: Write, parity: int) -> list[Call]:
    return memory.clear(write.resource, parity, write.clear, mip=write.mip, layer=write.layer)


def _copy(device: Device, memory: Memory, step: Step, parity: int) -> list[Call]:
    (read,), (write,) = step.reads, step.writes
    if isinstance(memory.plan.resources[read.resource].desc, BufferDesc):
        source, target = memory.buffer(read.resource, parity), memory.buffer(write.resource, parity)
        return [partial(device.ctx.copy_buffer, target, source)]
    return list(textures.copies(device, memory.texture(read.resource, parity), memory.texture(write.resource, parity)))


def _resolve(device: Device, memory: Memory, step: Step, parity: int) -> list[Call]:
    (read,), (write,) = step.reads, step.writes
    source, target = memory.attachment(read, parity), memory.attachment(write, parity)
    calls: list[Call] = []
    for layer in range(source.texture.desc.layers) if source.texture.desc.kind != "texture2d" else (None,):
        framebuffers = [memory.framebuffer([replace(end, layer=layer)], None, step.size) for end in (source, target)]
        names = [framebuffer.glo for framebuffer in framebuffers]
        box = (0, 0, *step.size)
        calls.append(framebuffers[1].use)  # sets the target's scissor and masks
        calls.append(partial(device.raw.glBlitNamedFramebuffer, *names, *box, *box, _COLOR, _NEAREST))
    return calls
