"""The scene as a node's `update` sees it: what is asked of all objects is found once, and again for those that move."""

from __future__ import annotations

from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.scene.model import Light, Material, Mesh, Object, Scene, Vec3
from rendergraph.scene.pack import changed_objects

Corners: TypeAlias = npt.NDArray[np.float64]


class FrameScene:
    """The scene of a frame, the same for as long as no object moves; see `steps.FrameScene`.

    Attributes:
        scene: of this frame.
        before: of the frames until now, whose meshes it shares.
        placed: of the frame in which the objects came to where they are.
    """

    def __init__(self, scene: Scene, before: FrameScene | None = None) -> None:
        self.scene = self.placed = scene
        if before is None or "_corners" not in vars(before) or before.placed.meshes is not self.scene.meshes:
            return
        moved = changed_objects(before.placed, self.scene)
        corners = before.corners.copy()
        corners[moved] = corners_of(self.meshes, [self.objects[number] for number in moved])
        vars(self)["_corners"] = corners
        if all(_flags(before.placed.objects[number]) == _flags(self.objects[number]) for number in moved):
            vars(self).update(_shown=before.shown, _casting=before.casting)

    @property
    def lights(self) -> tuple[Light, ...]:
        """The scene's lights, in its order."""
        return self.scene.lights

    @property
    def objects(self) -> tuple[Object, ...]:
        """Placed objects."""
        return self.scene.objects

    @property
    def materials(self) -> tuple[Material, ...]:
        """What `Object.material` counts through."""
        return self.scene.materials

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        """What `Object.mesh` counts through."""
        return self.scene.meshes

    @property
    def corners(self) -> Corners:
        """World-space corners of the objects' boxes, (n, 8, 3), z fastest."""
        return self._corners

    @property
    def shown(self) -> npt.NDArray[np.bool_]:
        """Which objects are not hidden, (n,)."""
        return self._shown

    @property
    def casting(self) -> npt.NDArray[np.bool_]:
        """Which of those cast a shadow, (n,)."""
        return self._casting

    @property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """Least and greatest corner of what is shown, a unit cube around the origin where nothing is."""
        return self._bounds

    @cached_property
    def _corners(self) -> Corners:
        return corners_of(self.meshes, self.objects)

    @cached_property
    def _shown(self) -> npt.NDArray[np.bool_]:
        return np.array([not entry.hidden for entry in self.objects], bool)

    @cached_property
    def _casting(self) -> npt.NDArray[np.bool_]:
        return np.array([entry.casts_shadow and not entry.hidden for entry in self.objects], bool)

    @cached_property
    def _bounds(self) -> tuple[Vec3, Vec3]:
        shown = self.corners if self.shown.all() else self.corners[self.shown]
        if not len(shown):
            return (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)
        (x, y, z), (u, v, w) = shown.min(axis=(0, 1)).tolist(), shown.max(axis=(0, 1)).tolist()
        return (x, y, z), (u, v, w)


def corners_of(meshes: tuple[Mesh, ...], objects: tuple[Object, ...] | list[Object]) -> Corners:
    """World-space corners of objects' boxes, (n, 8, 3)."""
    used = {number: place for place, number in enumerate(dict.fromkeys(entry.mesh for entry in objects))}
    boxes = np.array([meshes[number].box for number in used], np.float64).reshape(-1, 2, 3)
    transforms = np.array([entry.transform for entry in objects]).reshape(-1, 4, 4)
    low, high = boxes[[used[entry.mesh] for entry in objects]].reshape(-1, 2, 3).swapaxes(0, 1)
    far = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], bool)
    local = np.where(far, high[:, None], low[:, None])
    placed: Corners = local @ transforms[:, :3, :3].swapaxes(1, 2) + transforms[:, None, :3, 3]
    return placed


def _flags(entry: Object) -> tuple[bool, bool]:
    return entry.hidden, entry.casts_shadow
