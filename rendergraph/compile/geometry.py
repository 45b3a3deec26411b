"""Geometry steps to indirect multi-draws, which cost the same for ten objects and ten thousand.

A multi-draw is what can be drawn without changing anything: same macros, textures, culling and winding. How finely
objects must be told apart depends on what the step's shader looks at: a depth pass puts everything opaque into one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from rendergraph.compile.executable import Draw, SortedDraws
from rendergraph.compile.gpu_scene import GpuScene, MeshIndices
from rendergraph.compile.memory import Call
from rendergraph.compile.views import ViewBuffers
from rendergraph.expand import CAMERA
from rendergraph.program.variants import features, select
from rendergraph.scene.model import Texture
from rendergraph.steps import Step, ViewMatrices

COMMAND = np.dtype(
    [
        ("count", np.uint32),
        ("instances", np.uint32),
        ("first_index", np.uint32),
        ("base_vertex", np.int32),
        ("base_instance", np.uint32),
    ]
)
"""DrawElementsIndirectCommand."""


@dataclass(frozen=True)
class MultiDrawKey:
    """What makes two objects drawable together."""

    defines: tuple[tuple[str, str], ...]
    textures: tuple[tuple[str, Texture], ...]
    cull: str
    clockwise: bool


@dataclass(eq=False)
class MultiDraw:
    """Objects drawn by one indirect multi-draw.

    Attributes:
        defines: macros for the program.
        textures: sampler name to GL texture and sampler.
        cull: `back`, `front` or `none`.
        clockwise: whether front faces are clockwise.
        objects: object indices in the order they are drawn.
        commands: the buffer of draw commands.
        indices: what the commands count through.
    """

    defines: Mapping[str, str]
    textures: Mapping[str, tuple[int, int]]
    cull: str
    clockwise: bool
    objects: npt.NDArray[np.int64]
    commands: moderngl.Buffer
    indices: MeshIndices

    def call(self, vertex_array: Any) -> Call:
        """The draw."""
        return partial(vertex_array.render_indirect, self.commands, self.indices.mode, len(self.objects))


@dataclass(eq=False)
class GeometryCompiler:
    """Multi-draws of a scene's objects, and what keeps them front to back."""

    scene: GpuScene
    sorters: list[Callable[[ViewBuffers], None]] = field(default_factory=list)
    _multi_draws: dict[tuple[Any, ...], list[MultiDraw]] = field(default_factory=dict)
    buffers: list[moderngl.Buffer] = field(default_factory=list)

    def draws(self, step: Step, make: Callable[[MultiDraw], Draw]) -> list[Draw] | SortedDraws:
        """The draws of a step.

        Args:
            step: a geometry step.
            make: compiles a multi-draw's program.
        """
        objects = select(self.scene.scene, step)
        if not objects:
            return []
        if step.order == "front_to_back":
            return [make(multi_draw) for multi_draw in self._grouped(step, objects)]
        if step.order == "back_to_front":
            return self._sorted(step, objects, make)
        indices = self.scene.indices(step.topology)
        runs: list[tuple[MultiDrawKey, list[int]]] = []
        for index in objects:
            key = self._key(step, index)
            if runs and runs[-1][0] == key:
                runs[-1][1].append(index)
            else:
                runs.append((key, [index]))
        return [make(self._multi_draw(key, members, indices)) for key, members in runs]

    def _grouped(self, step: Step, objects: list[int]) -> list[MultiDraw]:
        view = (step.view or CAMERA, step.view_index or 0)
        key = (view, tuple(objects), step.materials, step.topology, step.state.cull, step.state.front)
        if key not in self._multi_draws:
            indices = self.scene.indices(step.topology)
            groups: dict[MultiDrawKey, list[int]] = {}
            for index in objects:
                groups.setdefault(self._key(step, index), []).append(index)
            self._multi_draws[key] = [self._multi_draw(alike, members, indices) for alike, members in groups.items()]
            for multi_draw in self._multi_draws[key]:
                if len(multi_draw.objects) > 1:
                    self.sorters.append(partial(self._sort, multi_draw, *view))
        return self._multi_draws[key]

    def _sorted(self, step: Step, objects: list[int], make: Callable[[MultiDraw], Draw]) -> SortedDraws:
        """A part for each kind of object over one list of commands, which is sorted far to near as the view moves."""
        keys = [self._key(step, index) for index in objects]
        parts = {key: number for number, key in enumerate(dict.fromkeys(keys))}
        members = np.array(objects, np.int64)
        part_of = np.array([parts[key] for key in keys], np.int64)
        indices = self.scene.indices(step.topology)
        commands = self._command_buffer(members, indices)
        draws = [make(self._multi_draw(key, objects[:1], indices)) for key in parts]

        def render(part: int, first: int, count: int) -> None:
            draws[part].vertex_array.render_indirect(commands, indices.mode, count, first)

        made = SortedDraws(draws, render)

        def sort(views: ViewBuffers) -> None:
            view = views.current[step.view or CAMERA][step.view_index or 0]
            order = np.argsort(-self._depths(members, view), kind="stable")
            commands.write(self._commands(members[order], indices).tobytes())
            kinds = part_of[order]
            starts = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), len(kinds)]
            made.runs = [(int(kinds[a]), a, b - a) for a, b in pairwise(starts)]

        self.sorters.append(sort)
        return made

    def _multi_draw(self, key: MultiDrawKey, members: list[int], indices: MeshIndices) -> MultiDraw:
        self.scene.load_images([texture for _, texture in key.textures])
        objects = np.array(members, np.int64)
        found = {name: self.scene.texture(texture) for name, texture in key.textures}
        commands = self._command_buffer(objects, indices)
        return MultiDraw(dict(key.defines), found, key.cull, key.clockwise, objects, commands, indices)

    def _command_buffer(self, objects: npt.NDArray[np.int64], indices: MeshIndices) -> moderngl.Buffer:
        buffer = self.scene.device.ctx.buffer(self._commands(objects, indices).tobytes() or bytes(COMMAND.itemsize))
        self.buffers.append(buffer)
        return buffer

    def _depths(self, objects: npt.NDArray[np.int64], view: ViewMatrices) -> npt.NDArray[np.float64]:
        """Distance along the view axis of objects' centres."""
        depths: npt.NDArray[np.float64] = -(self.scene.packed.centers[objects] @ view.view[2, :3] + view.view[2, 3])
        return depths

    def _commands(self, objects: npt.NDArray[np.int64], indices: MeshIndices) -> npt.NDArray[np.void]:
        meshes = indices.meshes[self.scene.packed.object_mesh[objects]]
        commands = np.zeros(len(objects), COMMAND)
        commands["count"] = meshes["count"]
        commands["instances"] = 1
        commands["first_index"] = meshes["first_index"]
        commands["base_vertex"] = meshes["base_vertex"]
        commands["base_instance"] = objects
        return commands

    def _sort(self, multi_draw: MultiDraw, table: str, index: int, views: ViewBuffers) -> None:
        depths = self._depths(multi_draw.objects, views.current[table][index])
        multi_draw.objects = multi_draw.objects[np.argsort(depths, kind="stable")]
        multi_draw.commands.write(self._commands(multi_draw.objects, multi_draw.indices).tobytes())

    def _key(self, step: Step, index: int) -> MultiDrawKey:
        scene = self.scene.scene
        placed = scene.objects[index]
        material = scene.materials[placed.material]
        defines, found = features(scene, index, step.materials)
        cull, front = step.state.cull, step.state.front
        clockwise = bool(self.scene.packed.mirrored[index]) if front == "object" else front == "clockwise"
        if cull == "material":
            cull = "none" if material.double_sided else "back"
        return MultiDrawKey(tuple(defines.items()), tuple(found.items()), cull, clockwise)
