"""What is bound once per frame: view tables and the frame block at binding points, textures in texture units.

Each pair of texture and sampler has its own unit. If a pipeline has more pairs than the driver has units, the last
units are shared, and steps bind them themselves. If full-screen draws of one program read different textures through
one sampler (a chain of blurs), the sampler keeps its unit and each draw binds its texture there: drivers validate a
program again when its samplers change units.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import moderngl
import numpy as np
from msgspec import Struct, field

from rendergraph.compile.memory import Call
from rendergraph.errors import Misuse, Problem, RenderError
from rendergraph.expand import CAMERA, ViewTable
from rendergraph.gl.device import Device
from rendergraph.program.variants import FIXED_BLOCKS
from rendergraph.scene.pack import VIEW, pack_view
from rendergraph.steps import ViewMatrices

SHARED_UNITS = 24


class ViewBuffers(Struct, eq=False, dict=True):
    """One buffer per view table, and the frame block.

    Attributes:
        changed, moved_before: the tables uploaded since these sets were emptied, and those of the previous frame.
    """

    device: Device
    tables: Mapping[str, ViewTable]
    current: dict[str, tuple[ViewMatrices, ...]] = {}
    changed: set[str] = set()
    moved_before: set[str] = set()
    _buffers: dict[str, moderngl.Buffer] = {}
    _packed: dict[str, bytes] = {}
    _before: dict[str, moderngl.Buffer] = {}
    _packed_before: dict[str, bytes] = {}
    _frame_bytes: bytes = b""

    def __post_init__(self) -> None:
        for name, table in self.tables.items():
            if table.count:
                self._buffers[name] = self.device.ctx.buffer(reserve=max(1, table.count) * VIEW.itemsize)
        self._frame = self.device.ctx.buffer(reserve=16)

    def binding(self, table: str) -> int:
        if table == CAMERA:
            return FIXED_BLOCKS["camera_block"]
        return len(FIXED_BLOCKS) + list(self.tables).index(table)

    def previous_binding(self, table: str) -> int:
        return len(FIXED_BLOCKS) + len(self.tables) + [CAMERA, *self.tables].index(table)

    @property
    def first_storage_binding(self) -> int:
        """The first binding point for the steps' own buffers: lights and materials may be storage blocks, too."""
        return len(FIXED_BLOCKS) + (2 * len(self.tables) + 1 if self.device.stores_blocks else 0)

    def keep_previous(self, table: str) -> None:
        """Store a table's views of the previous frame from now on, because a program uses them."""
        if table not in self._buffers or table in self._before:
            return
        if self.previous_binding(table) >= self.device.limits["uniform_bindings"]:
            text = f"view table '{table}' and its previous frame exceed the binding points of this device"
            raise RenderError(Problem("RG435", text))
        self._before[table] = self.device.ctx.buffer(reserve=max(1, self.tables[table].count) * VIEW.itemsize)

    @property
    def uses_previous(self) -> bool:
        """Whether any program uses views of the previous frame."""
        return bool(self._before)

    def advance(self) -> None:
        """Make the current views those of the previous frame."""
        for table, buffer in self._before.items():
            packed = self._packed.get(table)
            if packed is not None and self._packed_before.get(table) is not packed:
                self._packed_before[table] = packed
                buffer.write(packed)
                self.moved_before.add(table)

    def set(self, table: str, views: Sequence[ViewMatrices]) -> None:
        """Upload a table's views if they have changed."""
        now = tuple(views)
        if table not in self._buffers or self.current.get(table) == now:
            return
        packed = b"".join(pack_view(view) for view in now)
        expected = max(1, self.tables[table].count)
        if len(now) != expected:
            raise Misuse(f"'{table}' has {expected} views, but update set {len(now)}", "RG433")
        self.current[table] = now
        if self._packed.get(table) != packed:
            self._packed[table] = packed
            self._buffers[table].write(packed)
            self.changed.add(table)

    def set_frame(self, time: float, delta: float, index: int, still: int) -> bool:
        """Upload the frame block if it has changed; return whether it has."""
        now = np.array([time, delta], np.float32).tobytes() + np.array([index, still], np.int32).tobytes()
        if now == self._frame_bytes:
            return False
        self._frame_bytes = now
        self._frame.write(now)
        return True

    def bind(self) -> None:
        """Bind every block to its binding point; once per frame."""
        self.device.bind_block(self._frame, FIXED_BLOCKS["frame_block"])
        for name, buffer in self._buffers.items():
            self.device.bind_block(buffer, self.binding(name))
        for name, buffer in self._before.items():
            self.device.bind_block(buffer, self.previous_binding(name))

    def release(self) -> None:
        for buffer in (*self._buffers.values(), *self._before.values(), self._frame):
            buffer.release()


class Units(Struct, eq=False):
    """Assigns units while compiling, and binds them once per frame."""

    device: Device
    parities: int
    parity: int = 0
    _pairs: dict[tuple[tuple[int, ...], int], int] = field(default_factory=dict)
    _changing: list[int] = field(default_factory=list)
    _wrapped: dict[int, Any] = field(default_factory=dict)

    def unit(self, textures: tuple[int, ...], sampler: int, taken: list[Call]) -> int:
        """Return the unit of a texture (one GL name per parity) with a sampler.

        `taken` collects the bindings that the draw must make itself; it stays empty unless units run out.
        """
        pair = (textures, sampler)
        if pair in self._pairs or len(self._pairs) < self._own:
            return self._pairs.setdefault(pair, len(self._pairs))
        unit = self._own + sum(isinstance(call, partial) and call.func == self._rebind for call in taken)
        taken.append(partial(self._rebind, unit, textures, sampler))
        return unit

    def _rebind(self, unit: int, textures: tuple[int, ...], sampler: int) -> None:
        self.device.raw.glBindTextureUnit(unit, textures[self.parity % len(textures)])
        self.device.raw.glBindSampler(unit, sampler)

    @property
    def _own(self) -> int:
        return self.device.limits["units"] - SHARED_UNITS

    def changing(self, sampler: int) -> int | None:
        """Return a unit with a sampler whose texture draws bind; None if all are taken. Call it after `unit`."""
        if len(self._pairs) + len(self._changing) >= self._own:
            return None
        self._changing.append(sampler)
        return len(self._pairs) + len(self._changing) - 1

    def bind(self, texture: int, unit: int) -> Call:
        """Return a call that binds a plain 2D texture; moderngl's takes a quarter of the time of a raw one."""
        if texture not in self._wrapped:
            self._wrapped[texture] = self.device.ctx.external_texture(texture, (1, 1), 4, 0, "f1")
        return partial(self._wrapped[texture].use, unit)

    def binds(self) -> list[list[Call]]:
        """Return the calls that bind everything, one list per parity."""
        raw = self.device.raw
        pairs = [*self._pairs, *(((0,), sampler) for sampler in self._changing)]
        count = len(pairs)
        samplers = (ctypes.c_uint * count)(*(sampler for _, sampler in pairs))
        result: list[list[Call]] = []
        for parity in range(self.parities):
            names = (ctypes.c_uint * count)(*(t[parity % len(t)] for t, _ in pairs))
            calls: list[Call] = []
            if count:
                calls += [partial(raw.glBindTextures, 0, count, names), partial(raw.glBindSamplers, 0, count, samplers)]
            if self.parities > 1:
                calls.append(partial(setattr, self, "parity", parity))
            result.append(calls)
        return result
