"""The plan's physical textures as GL objects, with their views, framebuffers and samplers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cached_property, partial
from typing import Any

import moderngl
import numpy as np
from msgspec import Struct, field

from rendergraph.allocate import Physical, ResourcePlan
from rendergraph.errors import Problem, RenderError
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.gl.memory_objects import MemoryBlock, make_blocks
from rendergraph.gl.raw import RawGL
from rendergraph.gl.textures import ClearValue, GpuTexture, texel
from rendergraph.steps import Read, State, Write
from rendergraph.textures import FORMATS, BufferDesc, Sampler, TextureDesc

Call = Callable[[], object]

_TEXTURE_LABEL = 0x1702
_STATUS = {
    0x8CD6: "INCOMPLETE_ATTACHMENT",
    0x8CD7: "MISSING_ATTACHMENT",
    0x8CDD: "UNSUPPORTED",
    0x8D56: "INCOMPLETE_MULTISAMPLE",
    0x8DA8: "INCOMPLETE_LAYER_TARGETS",
}


class Attachment(Struct, frozen=True):
    """A mip level and layer of a texture as a render target; `layer` None attaches all layers."""

    texture: GpuTexture
    mip: int = 0
    layer: int | None = None

    def __str__(self) -> str:
        desc = self.texture.desc
        kind = desc.kind if self.layer is None else f"layer {self.layer} of a {desc.kind}"
        samples = f", {desc.samples} samples" if desc.samples > 1 else ""
        return f"a {desc.format} {kind} ({desc.width}×{desc.height}{samples})"


class Region(Struct, eq=False):
    """A part of the picture to which a node's `update` restricts its steps.

    Attributes:
        scissor: x, y, width and height; None for everything.
        depth_bounds: minimum and maximum depth, for drivers that support depth bounds.
        drawn: both values in the last frame.
    """

    scissor: tuple[int, int, int, int] | None = None
    depth_bounds: tuple[float, float] = (0.0, 1.0)
    drawn: tuple[object, object] = (None, (0.0, 1.0))

    def set(
        self, scissor: tuple[int, int, int, int] | None = None, depth_bounds: tuple[float, float] | None = None
    ) -> None:
        """Restrict drawing to this part from now on; by default to nothing."""
        self.scissor, self.depth_bounds = scissor, depth_bounds or (0.0, 1.0)

    def use(self, framebuffer: moderngl.Framebuffer) -> None:
        framebuffer.scissor = self.scissor  # type: ignore[assignment]  # None takes the scissor away
        framebuffer.use()

    def bound_depth(self, raw: RawGL) -> None:
        raw.glDepthBoundsEXT(*self.depth_bounds)


class TexturePool(Struct, eq=False):
    """Textures that several executables share: only one renders at a time, and none reads another's contents.

    So similar variants of a pipeline use one set of textures.
    """

    device: Device
    _pooled: dict[TextureDesc, list[GpuTexture]] = field(default_factory=dict)
    _users: Counter[GpuTexture] = field(default_factory=Counter)

    def acquire(self, desc: TextureDesc, number: int, label: str) -> GpuTexture:
        """Return the texture with this description and number; numbers start from 0 in each executable."""
        of_desc = self._pooled.setdefault(desc, [])
        if number == len(of_desc):
            of_desc.append(textures.create(self.device, desc, label))
        self._users[of_desc[number]] += 1
        return of_desc[number]

    def release(self, texture: GpuTexture) -> None:
        """Free a texture when its last user releases it."""
        of_desc = self._pooled[texture.desc]
        self._users[texture] -= 1
        while of_desc and not self._users[of_desc[-1]]:  # executables use the lowest numbers
            del self._users[of_desc[-1]]
            textures.delete(self.device, of_desc.pop())


class Memory(Struct, eq=False, dict=True):
    """Everything a pipeline allocates for one size.

    `parity` is the frame number's: histories swap their two copies with it. `regions` are the regions of steps, by node
    and number; `of_scene` returns a resource of the scene by its id.
    """

    device: Device
    plan: ResourcePlan
    of_scene: Callable[[str], GpuTexture | moderngl.Buffer]
    pool: TexturePool
    physicals: list[GpuTexture | moderngl.Buffer | MemoryBlock] = field(default_factory=list)
    regions: dict[tuple[str, int], Region] = field(default_factory=dict)
    _views: dict[tuple[object, ...], GpuTexture] = field(default_factory=dict)
    _samplers: dict[Sampler, int] = field(default_factory=dict)
    _framebuffers: dict[tuple[object, ...], moderngl.Framebuffer] = field(default_factory=dict)
    _dummies: dict[tuple[int, bool], moderngl.Renderbuffer] = field(default_factory=dict)
    _owned: ExitStack = field(default_factory=ExitStack)

    def __post_init__(self) -> None:
        numbers: Counter[TextureDesc] = Counter()
        descs = [[self._desc(id) for id in physical.members] for physical in self.plan.physicals if physical.block]
        blocks = make_blocks(self.device, descs)
        for block in blocks:
            self._owned.callback(block.release)
        try:
            for physical in self.plan.physicals:
                if physical.block:
                    self.physicals.append(blocks.pop(0))
                elif self.plan.resources[physical.members[0]].role == "scene":
                    self.physicals.append(self.of_scene(physical.members[0]))
                elif isinstance(physical.desc, BufferDesc):
                    buffer = self.device.ctx.buffer(reserve=max(16, physical.desc.bytes))
                    self._owned.callback(buffer.release)
                    self.physicals.append(buffer)
                else:
                    self.physicals.append(self._allocated(physical, physical.desc, numbers))
        except BaseException:
            self.release()
            raise

    def _allocated(self, physical: Physical, desc: TextureDesc, numbers: Counter[TextureDesc]) -> GpuTexture:
        """Return a texture of its own for kept values, or else one of the pool."""
        label = ", ".join(physical.members)
        if any(self.plan.resources[id].role == "kept" for id in physical.members):
            made = textures.create(self.device, desc, label)
            self._owned.callback(textures.delete, self.device, made)
        else:
            made = self.pool.acquire(desc, numbers[desc], label)
            self._owned.callback(self.pool.release, made)
            numbers[desc] += 1
        if self.device.ctx.supports_labels:
            self.device.ctx.mglo.set_label(_TEXTURE_LABEL, made.glo, label[:200])
        return made

    @cached_property
    def parities(self) -> int:
        """2 if any texture has a history, else 1."""
        return 2 if any(len(places) == 2 for places in self.plan.placement.values()) else 1

    def texture(self, resource: str, parity: int = 0, *, previous: bool = False) -> GpuTexture:
        """Return a resource's texture in its own format."""
        base = self.physicals[self._place(resource, parity, previous)]
        desc = self._desc(resource)
        if isinstance(base, MemoryBlock):
            return base.textures[desc]
        assert isinstance(base, GpuTexture), f"{resource} is a buffer"
        return base if desc.format == base.desc.format else self._view(base, desc.format, None, None)

    def _place(self, resource: str, parity: int, previous: bool) -> int:
        places = self.plan.placement[resource]
        return places[(parity + previous) % 2] if len(places) == 2 else places[0]

    def _desc(self, resource: str) -> TextureDesc:
        desc = self.plan.resources[resource].desc
        assert isinstance(desc, TextureDesc), f"{resource} is a buffer"
        return desc

    def part(self, resource: str, parity: int, read: Read) -> GpuTexture:
        """Return what a reader samples: the texture, or a view of one mip or layer."""
        texture = self.texture(resource, parity, previous=read.previous)
        if read.mip is None and read.layer is None:
            return texture
        return self._view(texture, texture.desc.format, read.mip, read.layer)

    def buffer(self, resource: str, parity: int = 0, *, previous: bool = False) -> moderngl.Buffer:
        found = self.physicals[self._place(resource, parity, previous)]
        assert isinstance(found, moderngl.Buffer), f"{resource} is a texture"
        return found

    def sampler(self, sampler: Sampler) -> int:
        if sampler not in self._samplers:
            made = self._samplers[sampler] = textures.create_sampler(self.device, sampler)
            self._owned.callback(self.device.raw.delete, "glDeleteSamplers", made)
        return self._samplers[sampler]

    def _view(self, texture: GpuTexture, format: str, mip: int | None, layer: int | None) -> GpuTexture:
        key = (texture.glo, format, mip, layer)
        if key not in self._views:
            made = self._views[key] = textures.view(self.device, texture, format=format, mip=mip, layer=layer)
            self._owned.callback(textures.delete, self.device, made)
        return self._views[key]

    def framebuffer(
        self,
        colors: Sequence[Attachment],
        depth: Attachment | None,
        size: tuple[int, int],
        state: State = State(),
        region: Region | None = None,
    ) -> moderngl.Framebuffer:
        """Return a framebuffer whose `use()` also sets viewport, masks and scissor; a region has one of its own.

        moderngl cannot attach wrapped depth textures, mips or layers, so it is made over 1×1 renderbuffers, which raw
        calls then replace by the real attachments.
        """
        depth_mask = state.depth_write is not False
        key = (tuple(colors), depth, size, state.color_mask, depth_mask, state.scissor, region)
        if key in self._framebuffers:
            return self._framebuffers[key]
        raw, ctx = self.device.raw, self.device.ctx
        stencil = depth is not None and FORMATS[depth.texture.desc.format].family == "depth_stencil"
        if colors or depth is not None:
            dummies = [self._dummy(number, depth=False) for number in range(len(colors))]
            made = ctx.framebuffer(dummies, self._dummy(0, depth=True) if depth is not None else None)
        else:  # a step that only stores images or buffers
            made = ctx.empty_framebuffer(size)
        self._owned.callback(made.release)
        points = {0x8CE0 + number: color for number, color in enumerate(colors)}
        if depth is not None:
            if stencil:
                raw.glNamedFramebufferTexture(made.glo, 0x8D00, 0, 0)
            points[0x821A if stencil else 0x8D00] = depth
        for point, each in points.items():
            textures.attach(self.device, made.glo, point, each.texture, each.mip, each.layer)
        status = raw.glCheckNamedFramebufferStatus(made.glo, 0x8D40)
        if status != 0x8CD5:
            every = " with ".join(str(target) for target in (*colors, depth) if target is not None)
            text = f"the driver does not draw to {every} ({_STATUS.get(status, hex(status))}); "
            raise RenderError(Problem("RG617", f"{text}a float format of the same channels may do"))
        made.viewport = (0, 0, *size)
        if colors:
            masks: Any = state.color_mask if len(colors) == 1 else (state.color_mask,) * len(colors)
            made.color_mask = masks
        made.depth_mask = depth_mask
        made.scissor = state.scissor  # type: ignore[assignment]  # None takes the scissor away
        self._framebuffers[key] = made
        return made

    def attachment(self, write: Write | Read, parity: int) -> Attachment:
        """Return the attachment of a step's target."""
        previous = isinstance(write, Read) and write.previous
        return Attachment(self.texture(write.resource, parity, previous=previous), write.mip or 0, write.layer)

    def clear(
        self, resource: str, parity: int, value: ClearValue, *, mip: int | None = None, layer: int | None = None
    ) -> list[Call]:
        """Return calls that clear a texture, mip or layer; views are cleared by a framebuffer (`textures.Clear`)."""
        texture = self.texture(resource, parity)
        place = self.plan.placement[resource][0]
        if texture in self.physicals or self.plan.physicals[place].block:
            return [textures.Clear(self.device, texture, value, mip=mip, layer=layer)]
        calls: list[Call] = []
        for level in range(texture.desc.mips) if mip is None else (mip,):
            target = self.framebuffer([Attachment(texture, level, layer)], None, texture.desc.mip_size(level))
            calls += [target.use, clear_target(self.device, target, 0, texture.desc.format, value)]
        return calls

    def _dummy(self, number: int, *, depth: bool) -> moderngl.Renderbuffer:
        key = (number, depth)
        if key not in self._dummies:
            ctx = self.device.ctx
            made = self._dummies[key] = ctx.depth_renderbuffer((1, 1)) if depth else ctx.renderbuffer((1, 1))
            self._owned.callback(made.release)
        return self._dummies[key]

    def release(self) -> None:
        self.device.unbind()
        self._owned.close()


def clear_target(
    device: Device, framebuffer: moderngl.Framebuffer, index: int | None, format: str, value: ClearValue
) -> Call:
    """Return the call that clears one attachment of a bound framebuffer, by its number or None for depth."""
    family = FORMATS[format].family
    ending = {"uint": "uiv", "int": "iv"}.get(family, "fv")
    data = texel(value, 4, {"uint": np.uint32, "int": np.int32}.get(family, np.float32))
    buffer = 0x1801 if family == "depth" else 0x1800
    function = getattr(device.raw, f"glClearNamedFramebuffer{ending}")
    call = partial(function, framebuffer.glo, buffer, index or 0, data.ctypes.data)
    call.data = data  # type: ignore[attr-defined]  # the array travels with the call: its address stays good
    return call
