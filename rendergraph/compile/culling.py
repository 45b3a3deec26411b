"""What a view sees of a scene's objects: those outside of it are not drawn, and the others near to far.

A box lies outside where it is beyond one side of the view altogether. A rasteriser finds nothing there, so no bit of a
picture depends on leaving it out: boxes are as large as the GPU's rounding may make them. That is worked out once for
each view that has moved, in NumPy over all objects; a list of draw commands is written where it has become another.
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
"""Of clip coordinates and of what is compared with them, relative to the sizes of their terms."""


def commands(packed: PackedScene, meshes: Records) -> Records:
    """`COMMAND` records that draw each object of a scene; `meshes` says where its indices lie."""
    found = np.zeros(len(packed.object_mesh), COMMAND)
    of = meshes[packed.object_mesh]
    for name in ("count", "first_index", "base_vertex"):
        found[name] = of[name]
    found["instances"], found["base_instance"] = 1, np.arange(len(found))
    return found


def visible_objects(packed: PackedScene, view: ViewMatrices, *, clamped: bool = False) -> Bools:
    """Which objects a view may see, bool (n,): false where an object's box lies beyond one side of it.

    Args:
        clamped: depth is clamped, so that what lies before the near plane or behind the far one is drawn as well.
    """
    x, y, z, w = reversed_projection(view) @ view.view
    sides = np.stack([w + x, w - x, w + y, w - y, *(() if clamped else (z, w - z))])
    terms = np.abs(w) + np.abs(np.stack([x, x, y, y, *(() if clamped else (z, z))]))
    reach = packed.extents + packed.slack
    inside = packed.centers @ sides[:, :3].T + reach @ np.abs(sides[:, :3]).T + sides[:, 3]
    slack = (np.abs(packed.centers) + reach) @ terms[:, :3].T + terms[:, 3]
    return np.asarray((inside + _ROUNDING * slack >= 0).all(axis=1))


class DrawList(Struct, eq=False):
    """Draw commands of some objects, of which those that are seen stand at the front of a buffer.

    Attributes:
        all: commands of every object of the scene.
        objects: what the list draws when all of it is seen, in the scene's order.
        changed: called with the objects that are drawn, in order, when these are others.
    """

    buffer: moderngl.Buffer
    all: Records
    objects: Objects
    order: DrawOrder
    changed: Callable[[Objects], object] | None = None
    drawn: Objects = field(default_factory=lambda: np.zeros(0, np.int64))

    def update(self, visible: Bools | None, depths: Doubles) -> None:
        """Draw what is visible, of equally far objects the scene's first one first."""
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
    """The lists that are drawn with one view, or with all views of a table where a shader chooses the layer.

    Attributes:
        table, index: the view; None for all of the table.
    """

    table: str
    index: int | None
    culls: bool
    clamped: bool
    lists: list[DrawList] = field(default_factory=list)

    def cull_and_sort(self, packed: PackedScene, views: ViewBuffers, *, cull: bool) -> None:
        """Bring all lists to what is seen now, in the order of its distance along the view's axis."""
        table = views.current[self.table]
        chosen = table if self.index is None else (table[self.index],)
        visible: Bools | None = None
        if self.culls and cull:
            visible = np.logical_or.reduce([visible_objects(packed, view, clamped=self.clamped) for view in chosen])
        depths = -(packed.centers @ chosen[0].view[2, :3] + chosen[0].view[2, 3])
        for each in self.lists:
            each.update(visible, depths)
