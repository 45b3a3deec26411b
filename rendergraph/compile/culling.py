"""Frustum culling, and sorting of visible objects by depth.

A box is culled if it lies entirely outside one plane of the frustum. Boxes are enlarged by the GPU's possible rounding,
so culling never changes a bit of a picture. Whenever a view has moved, NumPy culls all objects at once; a list of draw
commands is uploaded only if it has changed.
"""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from rendergraph.compile.views import ViewBuffers
from rendergraph.scene.pack import Bools, Doubles, PackedScene, Records, reversed_projection
from rendergraph.steps import ViewMatrices
from rendergraph.steps.model import DrawOrder

Objects = npt.NDArray[np.int64]

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

_ROUNDING = 8 * 2.0**-23
"""Rounding error of clip coordinates and of what they are compared with, relative to the sizes of their terms."""


def commands(packed: PackedScene, meshes: Records) -> Records:
    """Return `COMMAND` records that draw each object of a scene; `meshes` locates its indices."""
    found = np.zeros(len(packed.object_mesh), COMMAND)
    of = meshes[packed.object_mesh]
    for name in ("count", "first_index", "base_vertex"):
        found[name] = of[name]
    found["instances"], found["base_instance"] = 1, np.arange(len(found))
    return found


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
        all: commands of every object of the scene.
        objects: the objects that the list draws if all are visible, in the scene's order.
        changed: called with the drawn objects, in order, whenever they change.
    """

    buffer: moderngl.Buffer
    all: Records
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
            self.buffer.write(self.all[objects].tobytes())
        self.drawn = objects
        if self.changed is not None:
            self.changed(objects)


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
