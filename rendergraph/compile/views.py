"""View tables and the frame block as uniform buffers, each with its own binding point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np

from rendergraph.errors import Misuse
from rendergraph.expand import CAMERA, ViewTable
from rendergraph.gl.device import Device
from rendergraph.scene.pack import VIEW, pack_view
from rendergraph.steps import ViewMatrices

FIXED_BLOCKS = {"camera_block": 0, "frame_block": 1, "light_block": 2, "material_block": 3, "material_uv_block": 4}
"""Binding points of the blocks the framework keeps; view tables follow."""


@dataclass(eq=False)
class ViewBuffers:
    """One buffer a view table, and the frame block.

    Attributes:
        current: the views each table holds now.
    """

    device: Device
    tables: Mapping[str, ViewTable]
    current: dict[str, tuple[ViewMatrices, ...]] = field(default_factory=dict)
    changed: bool = True
    _buffers: dict[str, moderngl.Buffer] = field(default_factory=dict)
    _packed: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, table in self.tables.items():
            if table.count:
                self._buffers[name] = self.device.ctx.buffer(reserve=max(1, table.count) * VIEW.itemsize)
        self._frame = self.device.ctx.buffer(reserve=16)

    def binding(self, table: str) -> int:
        """The binding point of a table's block."""
        if table == CAMERA:
            return FIXED_BLOCKS["camera_block"]
        return len(FIXED_BLOCKS) + list(self.tables).index(table)

    def set(self, table: str, views: Sequence[ViewMatrices]) -> None:
        """Upload a table's views where they differ from what it holds."""
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
        self.changed = True

    def set_frame(self, time: float, delta: float, index: int) -> None:
        """Upload the frame block."""
        self._frame.write(np.array([time, delta], np.float32).tobytes() + np.array([index, 0], np.int32).tobytes())

    def bind(self) -> None:
        """Bind every block to its point; once a frame."""
        self._frame.bind_to_uniform_block(FIXED_BLOCKS["frame_block"])
        for name, buffer in self._buffers.items():
            buffer.bind_to_uniform_block(self.binding(name))

    def release(self) -> None:
        """Free the buffers."""
        for buffer in (*self._buffers.values(), self._frame):
            buffer.release()
        self._buffers.clear()
