"""Skinning and morphing: a compute shader poses the vertices of animated meshes whenever their pose has changed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import moderngl
import numpy as np
from msgspec import Struct, field

from rendergraph.errors import Problem, RenderError
from rendergraph.gl.device import Device
from rendergraph.program.text import VERSION
from rendergraph.resources import folder
from rendergraph.scene.model import Scene
from rendergraph.scene.pack import PackedScene
from rendergraph.scene.rig import Floats, Pose

_TARGET_STREAMS = ("positions", "normals", "tangents")
_MOST_GROUPS = 65535
_ALL_BARRIERS = 0xFFFFFFFF


class Posing(Struct, eq=False):
    """The animated meshes of a scene.

    Attributes:
        streams: the buffers to write: positions, normals and, if the scene has any, tangents.
        vertices: the vertices of the scene's data, with the number of floats per vertex, from their first use on.
        before: previous positions of all of the scene's vertices, from their first use on.
        poses: the pose in the buffers, by mesh.
        stale: the meshes whose pose differs from the previous frame.
    """

    device: Device
    streams: Mapping[str, moderngl.Buffer]
    rest: moderngl.Buffer
    state: moderngl.Buffer
    uniforms: Mapping[int, Mapping[str, tuple[int, ...]]]
    vertices: tuple[moderngl.Buffer, int] | None = None
    before: moderngl.Buffer | None = None
    poses: dict[int, Pose] = field(default_factory=dict)
    stale: set[int] = field(default_factory=set)
    _program: Any = None

    @classmethod
    def make(cls, device: Device, scene: Scene, packed: PackedScene, streams: Mapping[str, moderngl.Buffer]) -> Posing:
        """Upload the meshes at rest, and pose them as in the scene."""
        parts: list[Floats] = []
        uniforms: dict[int, dict[str, tuple[int, ...]]] = {}
        begin = state = 0
        poses = {placed.mesh: placed.pose for placed in scene.objects if placed.pose is not None}
        for number, pose in poses.items():
            record, deform = packed.meshes[number], pose.deform.at(packed.vertex_orders[number])
            first, count = int(record["base_vertex"]), int(record["vertices"])
            rest = [getattr(packed, name)[first : first + count] for name in streams]
            deltas = [deform.targets[name] for name in _TARGET_STREAMS if name in deform.targets]
            moved = np.concatenate(deltas, axis=2).swapaxes(0, 1).reshape(count, -1)
            table = np.concatenate([*rest, deform.joints.astype(np.float32), deform.weights, moved], axis=1)
            joints, targets = len(pose.joints), len(pose.weights)
            uniforms[number] = {
                "mesh": (first, count, begin, state),
                "sizes": (deform.joints.shape[1], joints, targets, table.shape[1]),
                "displaced": ("normals" in deform.targets, "tangents" in deform.targets),
            }
            parts.append(table.reshape(-1))
            begin, state = begin + table.size, state + 12 * joints + targets
        if 4 * begin > (most := device.limits["storage_block"]):
            text = f"the scene's animated meshes take {4 * begin} bytes, a storage block of this device holds {most}"
            raise RenderError(Problem("RG435", text))
        buffers = device.ctx.buffer(np.concatenate(parts).tobytes()), device.ctx.buffer(reserve=4 * max(state, 1))
        made = cls(device, streams, *buffers, uniforms)
        made.update(poses)
        return made

    def update(self, poses: Mapping[int, Pose]) -> bool:
        """Pose the vertices of meshes whose pose has changed; return whether there are any."""
        changed = {n: p for n, p in poses.items() if n not in self.poses or p.values != self.poses[n].values}
        self.poses |= changed
        self.stale |= changed.keys()
        for number, pose in changed.items():
            self.state.write(pose.values, offset=4 * self.uniforms[number]["mesh"][3])
        self._dispatch(changed)
        return bool(changed)

    def fill(self, vertices: moderngl.Buffer, width: int) -> None:
        """Also pose the vertices of the scene's data from now on."""
        self._program.release()
        self.vertices, self._program = (vertices, width), None
        self._dispatch(self.poses)

    def positions(self) -> Floats:
        """Read back the current positions of all of the scene's vertices, float32 (v, 3)."""
        return np.frombuffer(self.streams["positions"].read(), np.float32).reshape(-1, 3)

    def previous(self) -> moderngl.Buffer:
        """Return the positions in the previous frame, stored from now on."""
        if self.before is None:
            self.before = self.device.ctx.buffer(reserve=self.streams["positions"].size)
            self.device.ctx.copy_buffer(self.before, self.streams["positions"])
        return self.before

    def advance(self) -> bool:
        """Save the positions as those of the previous frame; return whether previous positions are used and changed."""
        stale, self.stale = self.stale, set()
        if self.before is None:
            return False
        for number in stale:
            first, count, *_ = self.uniforms[number]["mesh"]
            at = {"read_offset": 12 * first, "write_offset": 12 * first}
            self.device.ctx.copy_buffer(self.before, self.streams["positions"], 12 * count, **at)
        return bool(stale)

    def _dispatch(self, meshes: Collection[int]) -> None:
        if not meshes:
            return
        program = self._program = self._program or self._compiled()
        for point, buffer in enumerate((self.rest, self.state, *self.streams.values())):
            buffer.bind_to_storage_buffer(point)
        if self.vertices is not None:
            self.vertices[0].bind_to_storage_buffer(5)
            program["vertex_width"] = self.vertices[1]
        for number in meshes:
            for name, value in self.uniforms[number].items():
                program[name] = value
            groups = -(-self.uniforms[number]["mesh"][1] // 64)
            program.run(min(groups, _MOST_GROUPS), -(-groups // _MOST_GROUPS))
        self.device.raw.glMemoryBarrier(_ALL_BARRIERS)

    def _compiled(self) -> Any:
        macros = {"TANGENTS": "tangents" in self.streams, "SCENE_DATA": self.vertices is not None}
        defines = "".join(f"#define {name} 1\n" for name, yes in macros.items() if yes)
        text = (folder("rendergraph.shaders") / "include" / "pose.comp").read_text(encoding="utf-8")
        return self.device.ctx.compute_shader(f"{VERSION}\n{defines}{text}")

    def release(self) -> None:
        for each in (self.rest, self.state, self.before, self._program):
            if each is not None:
                each.release()
