"""Compile geometry steps into indirect multi-draws, which cost the same for ten objects and ten thousand.

A multi-draw has objects that need no state change: same macros, textures, culling and winding. How many multi-draws
are needed depends on what the step's shader uses: a depth pass draws all opaque objects in one.

An object's box is culled if it lies entirely outside one plane of the frustum. Boxes are enlarged by the GPU's possible
rounding, so culling never changes a bit of a picture. Whenever a view has moved, NumPy culls all objects at once; a
list of draw commands is uploaded only if it has changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from functools import partial
from itertools import groupby, pairwise
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from rendergraph.compile.bindings import ViewBuffers
from rendergraph.compile.executable import Draw, SortedDraws
from rendergraph.compile.gpu_scene import COMMAND, GpuScene, MeshIndices
from rendergraph.expand import CAMERA
from rendergraph.program.variants import features, select
from rendergraph.scene.model import Texture
from rendergraph.scene.pack import Bools, Doubles, PackedScene, reversed_projection
from rendergraph.steps import Step, ViewMatrices
from rendergraph.steps.model import DrawOrder

Objects = npt.NDArray[np.int64]

_ROUNDING = 8 * 2.0**-23
"""Rounding error of clip coordinates and of what they are compared with, relative to the sizes of their terms."""


def visible_objects(packed: PackedScene, view: ViewMatrices, *, clamped: bool = False) -> Bools:
    """Return which objects a view may see, bool (n,): false if an object's box lies outside one plane of the frustum.

    Args:
        clamped: depth is clamped, so that objects before the near plane or behind the far plane are drawn as well.
    """
    x, y, z, w = reversed_projection(view) @ view.view
    sides = np.stack([w + x, w - x, w + y, w - y, *(() if clamped else (z, w - z))])
    terms = np.abs(w) + np.abs(np.stack([x, x, y, y, *(() if clamped else (z, z))]))
    reach = packed.extents + packed.slack
    inside = packed.centers @ sides[:, :3].T + reach @ np.abs(sides[:, :3]).T + sides[:, 3]
    slack = (np.abs(packed.centers) + reach) @ terms[:, :3].T + terms[:, 3]
    return np.asarray((inside + _ROUNDING * slack >= 0).all(axis=1))


class DrawList(Struct, eq=False):
    """Draw commands of some objects; those of visible objects are at the front of a buffer.

    Attributes:
        indices: the scene's indices, with the commands of all of its objects.
        objects: the objects that the list draws if all are visible, in the scene's order.
        changed: called with the drawn objects, in order, whenever they change.
    """

    buffer: moderngl.Buffer
    indices: MeshIndices
    objects: Objects
    order: DrawOrder
    changed: Callable[[Objects], object] | None = None
    drawn: Objects = field(default_factory=lambda: np.zeros(0, np.int64))

    def update(self, visible: Bools | None, depths: Doubles) -> None:
        """Write the commands of visible objects; objects with equal depth keep the scene's order."""
        objects = self.objects if visible is None else self.objects[visible[self.objects]]
        if self.order != "scene":
            far = depths[objects]
            objects = objects[np.argsort(far if self.order == "front_to_back" else -far, kind="stable")]
        if np.array_equal(objects, self.drawn):
            return
        if len(objects):
            self.buffer.write(self.indices.commands[objects].tobytes())
        self.drawn = objects
        if self.changed is not None:
            self.changed(objects)

    def draw(self, vertex_array: Any) -> None:
        if len(self.drawn):
            vertex_array.render_indirect(self.buffer, self.indices.mode, len(self.drawn))


class SceneView(Struct, eq=False):
    """The lists that are drawn with one view, or with all views of a table if a shader chooses the layer.

    Attributes:
        table, index: the view; None for all views of the table.
    """

    table: str
    index: int | None
    culls: bool
    clamped: bool
    lists: list[DrawList] = field(default_factory=list)

    def cull_and_sort(self, packed: PackedScene, views: ViewBuffers, *, cull: bool) -> None:
        """Update all lists to the visible objects, sorted by depth along the view's axis."""
        table = views.current[self.table]
        chosen = table if self.index is None else (table[self.index],)
        visible: Bools | None = None
        if self.culls and cull:
            visible = np.logical_or.reduce([visible_objects(packed, view, clamped=self.clamped) for view in chosen])
        depths = -(packed.centers @ chosen[0].view[2, :3] + chosen[0].view[2, 3])
        for each in self.lists:
            each.update(visible, depths)


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
        draw: draws them with a vertex array.
    """

    key: MultiDrawKey
    textures: Mapping[str, tuple[int, int]]
    draw: Callable[[Any], object]


class GeometryCompiler(Struct, eq=False):
    """Multi-draws of a scene's objects, and the views that decide which objects they draw."""

    scene: GpuScene
    owned: ExitStack
    views: dict[tuple[Any, ...], SceneView] = field(default_factory=dict)
    _multi_draws: dict[tuple[Any, ...], list[MultiDraw]] = field(default_factory=dict)

    def cull_and_sort(self, views: ViewBuffers, *, moved: bool, cull: bool) -> None:
        """Update the lists of views that have changed, or of all if objects have moved."""
        for view in self.views.values():
            if moved or view.table in views.changed:
                view.cull_and_sort(self.scene.packed, views, cull=cull)

    def draws(self, step: Step, make: Callable[[MultiDraw], Draw]) -> list[Draw] | SortedDraws:
        objects = select(self.scene.scene, step)
        if not objects:
            return []
        if step.order == "back_to_front":
            return self._sorted(step, objects, make)
        if step.order == "front_to_back":
            state = step.state.cull, step.state.front
            key = (*self._view_key(step), tuple(objects), step.materials, step.topology, *state)
            if key not in self._multi_draws:
                groups = self._groups(step, objects)
                self._multi_draws[key] = [self._listed(step, alike, members) for alike, members in groups.items()]
            return [make(multi_draw) for multi_draw in self._multi_draws[key]]
        return [make(self._listed(step, key, members)) for key, members in groupby(objects, partial(self._key, step))]

    def by_commands(self, step: Step, buffer: moderngl.Buffer, make: Callable[[MultiDraw], Draw]) -> list[Draw]:
        """Return draws that take their commands from a buffer, one for each object, without culling by the step."""
        mode, draws = self.scene.indices(step.topology).mode, []
        for key, members in self._groups(step, select(self.scene.scene, step)).items():
            ordered = np.sort(members)
            runs = [(int(run[0]), len(run)) for run in np.split(ordered, np.flatnonzero(np.diff(ordered) != 1) + 1)]
            draws.append(make(self._multi_draw(key, partial(_draw_runs, buffer, mode, runs))))
        return draws

    def _groups(self, step: Step, objects: list[int]) -> dict[MultiDrawKey, list[int]]:
        groups: dict[MultiDrawKey, list[int]] = {}
        for index in objects:
            groups.setdefault(self._key(step, index), []).append(index)
        return groups

    def _sorted(self, step: Step, objects: list[int], make: Callable[[MultiDraw], Draw]) -> SortedDraws:
        """Return one part per kind of object over one list of commands, sorted far to near whenever the view moves."""
        groups = self._groups(step, objects)
        part_of = np.zeros(max(objects) + 1, np.int64)
        for part, members in enumerate(groups.values()):
            part_of[members] = part
        whole = self._list(step, objects)
        draws = [make(self._multi_draw(key, whole.draw)) for key in groups]

        def render(part: int, first: int, count: int) -> None:
            draws[part].vertex_array.render_indirect(whole.buffer, whole.indices.mode, count, first)

        made = SortedDraws(draws, render)

        def changed(drawn: Objects) -> None:
            kinds = part_of[drawn]
            ends = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), len(kinds)]
            made.runs = [(int(kinds[a]), a, b - a) for a, b in pairwise(ends) if b > a]

        whole.changed = changed
        return made

    def _listed(self, step: Step, key: MultiDrawKey, members: Iterable[int]) -> MultiDraw:
        return self._multi_draw(key, self._list(step, members).draw)

    def _multi_draw(self, key: MultiDrawKey, draw: Callable[[Any], object]) -> MultiDraw:
        self.scene.load_images([texture for _, texture in key.textures])
        return MultiDraw(key, {name: self.scene.texture(texture) for name, texture in key.textures}, draw)

    def _list(self, step: Step, members: Iterable[int]) -> DrawList:
        """Return the commands of objects, updated whenever the step's view or an object has moved."""
        objects = np.array(list(members), np.int64)
        buffer = self.scene.device.ctx.buffer(reserve=len(objects) * COMMAND.itemsize)
        self.owned.callback(buffer.release)
        made = DrawList(buffer, self.scene.indices(step.topology), objects, step.order)
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


def _draw_runs(buffer: moderngl.Buffer, mode: int, runs: list[tuple[int, int]], vertex_array: Any) -> None:
    """Draw runs of consecutive objects, each given by its first object and their number."""
    for first, count in runs:
        vertex_array.render_indirect(buffer, mode, count, first)
