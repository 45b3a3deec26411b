"""View tables and the frame block as uniform buffers, each with its own binding point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
from msgspec import Struct

from rendergraph.errors import Misuse, Problem, RenderError
from rendergraph.expand import CAMERA, ViewTable
from rendergraph.gl.device import Device
from rendergraph.program.variants import FIXED_BLOCKS
from rendergraph.scene.pack import VIEW, pack_view
from rendergraph.steps import ViewMatrices


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
        if table not in self._buffers:
            return
        if self.current.get(table) == now:
            return
        packed = b"".join(pack_view(view) for view in now)
        expected = max(1, self.tables[table].count)
        if len(now) != expected:
            raise Misuse(f"'{table}' has {expected} views, but update set {len(now)}", "RG433")
        self.current[table] = now
        if self._packed.get(table) == packed:
            return
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
        self._buffers.clear()
        self._before.clear()
