"""Average light over the moments of the open shutter, for `subframes`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import moderngl
from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.allocate import ResourcePlan
from rendergraph.compile.executable import Executable
from rendergraph.compile.memory import Attachment, Call
from rendergraph.gl import state as gl_state
from rendergraph.gl import textures
from rendergraph.gl.textures import GpuTexture
from rendergraph.program.text import VERSION
from rendergraph.resources import folder
from rendergraph.steps.model import ADD, State
from rendergraph.textures import Semantic, TextureDesc

_ALL_BARRIERS = 0xFFFFFFFF


def averaged_textures(plan: ResourcePlan, semantics: Mapping[str, Semantic]) -> dict[int, dict[str, bool]]:
    """Return, by position in the schedule, the textures to average before that step, and whether they are encoded.

    Scene-linear light is averaged before a step that converts it to display colours, and in outputs at the end of the
    frame. Outputs of display colours that do not come from such light are decoded for averaging.
    """
    resources, steps = plan.resources, plan.schedule.steps
    encodings = {
        name: semantics[known].encoding
        for name, one in resources.items()
        if isinstance(one.desc, TextureDesc) and one.desc.kind == "texture2d" and one.role not in ("kept", "scene")
        if (known := name.removesuffix(" kept")) in semantics
    }
    found: dict[int, dict[str, bool]] = {}
    averaged: set[tuple[str, int]] = set()
    newest: dict[str, int] = {}
    derived: set[str] = set()  # resources computed from a mean
    for position, step in enumerate(steps):
        shows = any(encodings.get(write.resource) == "display" for write in step.writes)
        for read in step.all_reads:
            light = shows and not read.previous and encodings.get(read.resource) == "linear"
            if light and (read.resource, read.version) not in averaged:
                averaged.add((read.resource, read.version))
                found.setdefault(position, {})[read.resource] = False
            if light or (read.resource in derived and not read.previous):
                derived.update(write.resource for write in step.writes)
        newest |= {write.resource: write.version for write in step.writes}
    for name in plan.schedule.outputs.values():
        encoding = encodings.get(name)
        if encoding == "linear" and (name, newest.get(name, 0)) not in averaged:
            found.setdefault(len(steps), {})[name] = False
        elif encoding == "display" and name not in derived:
            found.setdefault(len(steps), {})[name] = True
    return found


class LightMeans(Struct, eq=False):
    """Sums of light over a frame's moments; the last moment divides them and writes the means back.

    Attributes:
        stops: the result of `averaged_textures`.
        moment, count: the current moment, from 0, and the number of moments.
    """

    executable: Executable
    stops: Mapping[int, Mapping[str, bool]]
    moment: int = 0
    count: int = 1
    _sums: dict[str, GpuTexture] = field(default_factory=dict)
    _programs: dict[tuple[int, str], tuple[Any, Any]] = field(default_factory=dict)

    def calls(self, parity: int) -> dict[int, Call]:
        """Return the calls to insert before some positions of the schedule; the last position is after all steps."""
        return {at: partial(self._add_all, parity, names) for at, names in self.stops.items()}

    def _add_all(self, parity: int, names: Mapping[str, bool]) -> None:
        executable = self.executable
        executable.device.raw.glMemoryBarrier(_ALL_BARRIERS)
        for name, encoded in names.items():
            source = executable.memory.texture(name, parity)
            if name not in self._sums:
                desc = replace(source.desc, format="rgba32f", mips=1)
                total = self._sums[name] = textures.create(executable.device, desc, f"the mean of {name}")
                executable.owned.callback(textures.delete, executable.device, total)
            self._draw(source, self._sums[name], "DECODE" if encoded else "", 1.0, adds=self.moment > 0)
            if self.moment == self.count - 1:
                self._draw(self._sums[name], source, "ENCODE" if encoded else "", float(self.count), adds=False)
        for call in executable.binds[parity]:
            call()

    def _draw(self, source: GpuTexture, target: GpuTexture, define: str, divisor: float, *, adds: bool) -> None:
        device, samples = self.executable.device, source.desc.samples
        if (samples, define) not in self._programs:
            program = device.ctx.program(
                vertex_shader=f"{VERSION}\n{_shader('fullscreen.vert')}",
                fragment_shader=f"{VERSION}\n#define SAMPLES {samples}\n{f'#define {define} 1' if define else ''}\n"
                f"{_shader('srgb.glsl')}{_shader('light_mean.frag')}",
            )
            vertex_array = device.ctx.vertex_array(program, [])
            self._programs[samples, define] = program, vertex_array
            self.executable.owned.callback(program.release)
            self.executable.owned.callback(vertex_array.release)
        program, vertex_array = self._programs[samples, define]
        state = State(blend=ADD if adds else None)
        self.executable.memory.framebuffer([Attachment(target)], None, target.desc.size).use()
        for call in gl_state.changes(None, gl_state.pieces(device.raw, state, depth_test=False, cull="none")):
            call()
        device.raw.glBindTextureUnit(0, source.glo)
        device.raw.glBindSampler(0, 0)
        program["divisor"] = divisor
        vertex_array.render(moderngl.TRIANGLES, 3)


def _shader(name: str) -> str:
    return (folder("rendergraph.shaders") / "include" / name).read_text(encoding="utf-8")
