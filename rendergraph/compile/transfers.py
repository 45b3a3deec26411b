"""Operations without a program: clears, mip chains, copies and uploads; and image bindings of compute shaders."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from rendergraph.compile.gpu_scene import GpuScene
from rendergraph.compile.memory import Call, Memory
from rendergraph.errors import Misuse, Place, shown_file
from rendergraph.gl import textures
from rendergraph.scene.facts import FrameScene
from rendergraph.steps.checks import texels
from rendergraph.steps.model import Read, Step, Upload, Write
from rendergraph.textures import FORMATS, BufferDesc

_COLOR, _NEAREST = 0x4000, 0x2600
_R8UI, _RED_INTEGER, _UNSIGNED_BYTE, _READ_WRITE = 0x8232, 0x8D94, 0x1401, 0x88BA

SCENE_CHANGES = {
    "transforms": "instances",
    "lights": "light_block",
    "materials": "material_block",
    "environment": "environment_block",
    "camera": "camera",
}
"""The parts of a scene that can change, by the counters of `GpuScene.changes`."""


def transfer_calls(memory: Memory, step: Step, parity: int) -> list[Call]:
    if step.kind == "copy":
        return _copy(memory, step, parity)
    if step.kind == "resolve":
        return _resolve(memory, step, parity)
    if step.kind == "mipmaps":
        names = [memory.texture(write.resource, parity).glo for write in step.writes]
        return [partial(memory.device.raw.glGenerateTextureMipmap, name) for name in names]
    calls: list[Call] = []
    for write in step.writes:
        if write.use == "buffer":
            calls.append(clear_buffer(memory, write, parity))
        else:
            calls += _clear(memory, write, parity)
    return calls


def clear_buffer(memory: Memory, write: Write, parity: int) -> Call:
    """Return a call that clears a buffer on the device: moderngl's clear maps the buffer, and so waits for readers."""
    glo = memory.buffer(write.resource, parity).glo
    return partial(memory.device.raw.glClearNamedBufferData, glo, _R8UI, _RED_INTEGER, _UNSIGNED_BYTE, None)


def image_calls(memory: Memory, step: Step, parity: int) -> tuple[list[Call], dict[str, int]]:
    """Return the calls that bind and clear the images of a compute step, and the image unit of each name."""
    images: list[Read | Write] = [read for read in step.reads if read.use == "image"]
    images += [write for write in step.writes if write.use == "image"]
    calls: list[Call] = []
    for unit, touched in enumerate(images):
        image = memory.attachment(touched, parity)
        texture, layered = image.texture, image.layer is None and image.texture.desc.kind != "texture2d"
        given = image.mip, int(layered), image.layer or 0, _READ_WRITE, FORMATS[texture.desc.format].gl
        calls.append(partial(memory.device.raw.glBindImageTexture, unit, texture.glo, *given))
    for write in step.writes:
        if write.use == "image" and write.load == "clear":
            calls += _clear(memory, write, parity)
    return calls, {touched.name: unit for unit, touched in enumerate(images)}


def _clear(memory: Memory, write: Write, parity: int) -> list[Call]:
    return memory.clear(write.resource, parity, write.clear, mip=write.mip, layer=write.layer)


def _copy(memory: Memory, step: Step, parity: int) -> list[Call]:
    (read,), (write,) = step.reads, step.writes
    if isinstance(memory.plan.resources[read.resource].desc, BufferDesc):
        source, target = memory.buffer(read.resource, parity), memory.buffer(write.resource, parity)
        return [partial(memory.device.ctx.copy_buffer, target, source)]
    texture, copy = memory.texture(read.resource, parity), memory.texture(write.resource, parity)
    return textures.copies(memory.device, texture, copy)


def _resolve(memory: Memory, step: Step, parity: int) -> list[Call]:
    (read,), (write,) = step.reads, step.writes
    source, target = memory.attachment(read, parity), memory.attachment(write, parity)
    calls: list[Call] = []
    for layer in range(source.texture.desc.layers) if source.texture.desc.kind != "texture2d" else (None,):
        framebuffers = [memory.framebuffer([replace(end, layer=layer)], None, step.size) for end in (source, target)]
        names = [framebuffer.glo for framebuffer in framebuffers]
        box = (0, 0, *step.size)
        calls.append(framebuffers[1].use)  # sets the target's scissor and masks
        calls.append(partial(memory.device.raw.glBlitNamedFramebuffer, *names, *box, *box, _COLOR, _NEAREST))
    return calls


class UploadedValues(Struct, eq=False):
    """The values of one upload step; `step` returns it with the current parameters of its node."""

    step: Callable[[], Step]
    scene: GpuScene
    memory: Memory
    _array: npt.NDArray[Any] | None = None
    _made_of: object = None

    @property
    def is_stale(self) -> bool:
        """Whether the values must be computed, for the first time or again."""
        return self._made_of != self._sources

    @property
    def _sources(self) -> object:
        return self.upload, [self.scene.changes[SCENE_CHANGES[source]] for source in self.upload.sources]

    @property
    def upload(self) -> Upload:
        found = dict(self.step().uniforms)["values"]
        assert isinstance(found, Upload)
        return found

    def compute(self) -> None:
        """Compute the values; exceptions of third-party functions propagate."""
        values, (write,) = self.upload.values, self.step().writes
        if callable(values):
            desc = self.memory.plan.resources[write.resource].desc
            code = getattr(getattr(values, "__func__", values), "__code__", None)
            array = values(FrameScene(self.scene.scene, decode=self.scene.decode))
            try:
                values = texels(write.name, array, desc, write.mip, write.layer)
            except Misuse as error:  # the function has returned, so its first line is the closest place
                place = Place(shown_file(code.co_filename), code.co_firstlineno, 1) if code is not None else None
                raise Misuse(str(error), error.code, place) from None
        self._array, self._made_of = values, self._sources

    def write(self, parity: int) -> None:
        (write,) = self.step().writes
        assert self._array is not None
        if write.use == "buffer":
            self.memory.buffer(write.resource, parity).write(self._array)
        else:
            texture = self.memory.texture(write.resource, parity)
            textures.upload(self.memory.device, texture, self._array, mip=write.mip or 0, layer=write.layer)
