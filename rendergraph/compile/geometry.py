"""Compile geometry steps into indirect multi-draws, which cost the same for ten objects and ten thousand.

A multi-draw has objects that need no state change: same macros, textures, culling and winding. How many multi-draws
are needed depends on what the step's shader uses: a depth pass draws all opaque objects in one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np
from msgspec import Struct, field

from rendergraph.compile.culling import COMMAND, DrawList, Objects, SceneView
from rendergraph.compile.executable import Draw, SortedDraws
from rendergraph.compile.gpu_scene import GpuScene
from rendergraph.compile.memory import Call
from rendergraph.expand import CAMERA
from rendergraph.program.variants import features, select
from rendergraph.scene.model import Texture
from rendergraph.steps import Step


class MultiDrawKey(Struct, frozen=True):
    """Objects with equal keys can be drawn together."""

    defines: tuple[tuple[str, str], ...]
    textures: tuple[tuple[str, Texture], ...]
    cull: str
    clockwise: bool


class MultiDraw(Struct, eq=False):
    """Objects drawn by one indirect multi-draw.

    Attributes:
        textures: sampler name to GL texture and sampler.
    """

    defines: Mapping[str, str]
    textures: Mapping[str, tuple[int, int]]
    cull: str
    clockwise: bool
    list: DrawList | None
    mode: int

    def call(self, vertex_array: Any) -> Call:
        drawn, mode = self.list, self.mode
        assert drawn is not None

        def call() -> None:
            if len(drawn.drawn):
                vertex_array.render_indirect(drawn.buffer, mode, len(drawn.drawn))

        return call


class CommandDraw(MultiDraw, eq=False):
    """Objects drawn by commands that a shader writes, one for each object of the scene.

    Attributes:
        buffer: the commands.
        runs: first object and count of each run of consecutive objects that are drawn together.
    """

    buffer: moderngl.Buffer
    runs: tuple[tuple[int, int], ...]

    def call(self, vertex_array: Any) -> Call:
        calls = [partial(vertex_array.render_indirect, self.buffer, self.mode, n, first) for first, n in self.runs]
        if len(calls) == 1:
            return calls[0]

        def call() -> None:
            for each in calls:
                each()

        return call


class GeometryCompiler(Struct, eq=False):
    """Multi-draws of a scene's objects, and the views that decide which objects they draw."""

    scene: GpuScene
    views: dict[tuple[Any, ...], SceneView] = field(default_factory=dict)
    _multi_draws: dict[tuple[Any, ...], list[MultiDraw]] = field(default_factory=dict)
    buffers: list[moderngl.Buffer] = field(default_factory=list)

    def draws(self, step: Step, make: Callable[[MultiDraw], Draw]) -> list[Draw] | SortedDraws:
        objects = select(self.scene.scene, step)
        if not objects:
            return []
        if step.order == "front_to_back":
            return [make(multi_draw) for multi_draw in self._grouped(step, objects)]
        if step.order == "back_to_front":
            return self._sorted(step, objects, make)
        runs: list[tuple[MultiDrawKey, list[int]]] = []
        for index in objects:
            key = self._key(step, index)
            if runs and runs[-1][0] == key:
                runs[-1][1].append(index)
            else:
                runs.append((key, [index]))
        return [make(self._multi_draw(step, key, members)) for key, members in runs]

    def by_commands(self, step: Step, buffer: moderngl.Buffer, make: Callable[[MultiDraw], Draw]) -> list[Draw]:
        """Return draws that take their commands from a buffer, without culling by the step."""
        groups: dict[MultiDrawKey, list[int]] = {}
        for index in select(self.scene.scene, step):
            groups.setdefault(self._key(step, index), []).append(index)
        mode, draws = self.scene.indices(step.topology).mode, []
        for key, members in groups.items():
            like = self._with_textures(key, None, mode)
            ordered = sorted(members)
            starts = [at for at, n in enumerate(ordered) if at == 0 or ordered[at - 1] != n - 1]
            runs = tuple((ordered[a], b - a) for a, b in pairwise([*starts, len(ordered)]))
            state = like.defines, like.textures, like.cull, like.clockwise
            draws.append(make(CommandDraw(*state, None, mode, buffer, runs)))
        return draws

    def _grouped(self, step: Step, objects: list[int]) -> list[MultiDraw]:
        state = step.state.cull, step.state.front
        key = (*self._view_key(step), tuple(objects), step.materials, step.topology, *state)
        if key not in self._multi_draws:
            groups: dict[MultiDrawKey, list[int]] = {}
            for index in objects:
                groups.setdefault(self._key(step, index), []).append(index)
            self._multi_draws[key] = [self._multi_draw(step, alike, members) for alike, members in groups.items()]
        return self._multi_draws[key]

    def _sorted(self, step: Step, objects: list[int], make: Callable[[MultiDraw], Draw]) -> SortedDraws:
        """Return one part per kind of object over one list of commands, sorted far to near whenever the view moves."""
        keys = [self._key(step, index) for index in objects]
        parts = {key: number for number, key in enumerate(dict.fromkeys(keys))}
        part_of = np.zeros(max(objects) + 1, np.int64)
        part_of[objects] = [parts[key] for key in keys]
        whole = self._list(step, objects)
        mode = self.scene.indices(step.topology).mode
        draws = [make(self._with_textures(key, whole, mode)) for key in parts]

        def render(part: int, first: int, count: int) -> None:
            draws[part].vertex_array.render_indirect(whole.buffer, mode, count, first)

        made = SortedDraws(draws, render)

        def changed(drawn: Objects) -> None:
            kinds = part_of[drawn]
            ends = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), len(kinds)]
            made.runs = [(int(kinds[a]), a, b - a) for a, b in pairwise(ends) if b > a]

        whole.changed = changed
        return made

    def _multi_draw(self, step: Step, key: MultiDrawKey, members: list[int]) -> MultiDraw:
        return self._with_textures(key, self._list(step, members), self.scene.indices(step.topology).mode)

    def _with_textures(self, key: MultiDrawKey, drawn: DrawList | None, mode: int) -> MultiDraw:
        self.scene.load_images([texture for _, texture in key.textures])
        found = {name: self.scene.texture(texture) for name, texture in key.textures}
        return MultiDraw(dict(key.defines), found, key.cull, key.clockwise, drawn, mode)

    def _list(self, step: Step, members: list[int]) -> DrawList:
        """Return the commands of objects, updated whenever the step's view or an object has moved."""
        buffer = self.scene.device.ctx.buffer(reserve=len(members) * COMMAND.itemsize)
        self.buffers.append(buffer)
        commands = self.scene.indices(step.topology).commands
        made = DrawList(buffer, commands, np.array(members, np.int64), step.order)
        key = self._view_key(step)
        self.views.setdefault(key, SceneView(*key)).lists.append(made)
        return made

    def _view_key(self, step: Step) -> tuple[str, int | None, bool, bool]:
        return step.view or CAMERA, step.view_index, step.in_place, step.state.depth_clamp

    def _key(self, step: Step, index: int) -> MultiDrawKey:
        scene = self.scene.scene
        placed = scene.objects[index]
        material = scene.materials[placed.material]
        defines, found = features(scene, index, step.materials)
        cull, front = step.state.cull, step.state.front
        clockwise = bool(self.scene.packed.mirrored[index]) if front == "object" else front == "clockwise"
        if cull == "material":
            cull = "none" if material.double_sided else "back"
        elif cull == "solid":
            plain = material.alpha_mode == "opaque" and not material.double_sided
            cull = "back" if plain and scene.meshes[placed.mesh].solid else "none"
        return MultiDrawKey(tuple(defines.items()), tuple(found.items()), cull, clockwise)
