"""Views of a scene for stages without a GPU and for `update`: facts of its parts, and the scene of a frame."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.declare import CameraFacts, LightFacts, MaterialFacts
from rendergraph.facts import SELECTIONS, ObjectFacts
from rendergraph.scene.model import (
    Camera,
    ImageSource,
    Light,
    Material,
    Mesh,
    Object,
    Scene,
    Vec3,
    boxes_of,
    changed_objects,
)
from rendergraph.textures import TextureDesc, full_mip_count

Corners: TypeAlias = npt.NDArray[np.float64]
Decode: TypeAlias = Callable[[ImageSource, bool], npt.NDArray[Any]]
"""Image to (height, width, 4) uint8 or floats, top row first; the flag says that colours are sRGB."""


def selected(scene: Scene, name: str) -> list[int]:
    takes = SELECTIONS[name]
    return [
        number
        for number, placed in enumerate(scene.objects)
        if not placed.hidden and takes(placed.casts_shadow, scene.is_blended(scene.materials[placed.material]))
    ]


def object_facts(scene: Scene) -> tuple[ObjectFacts, ...]:
    facts = []
    for placed in scene.objects:
        mesh, material = scene.meshes[placed.mesh], scene.materials[placed.material]
        facts.append(
            ObjectFacts(
                placed.name,
                len(mesh.indices),
                len(mesh.positions),
                placed.casts_shadow,
                scene.is_blended(material),
                material.double_sided,
                placed.hidden,
                scene.has_grain(material),
                scene.emits(material),
                scene.reflects(material),
                mesh.name,
                partial(attrgetter("edges.gap"), mesh),
                partial(attrgetter("plane"), mesh),
                partial(attrgetter("convex"), mesh),
                placed.extra,
                scene.layers(material),
            )
        )
    return tuple(facts)


def light_facts(scene: Scene) -> tuple[LightFacts, ...]:
    return tuple(LightFacts(light.name, light.type, light.casts_shadow, light.extra) for light in scene.lights)


def material_facts(scene: Scene) -> tuple[MaterialFacts, ...]:
    return tuple(MaterialFacts(material.name, material.extra) for material in scene.materials)


def camera_facts(scene: Scene) -> CameraFacts:
    """Return the facts of the first camera, which renders."""
    if (camera := scene.camera) is None:
        return CameraFacts()
    curve = scene.keyframes.get(f"cameras.{camera.name}.shutter")
    most = camera.shutter if curve is None else max(camera.shutter, float(curve.values.max()))
    return CameraFacts(camera.name, camera.extra, most)


def environment_facts(scene: Scene) -> TextureDesc | None:
    if scene.environment is None:
        return None
    size = scene.environment.size
    assert size is not None  # set by the readers of scenes
    return TextureDesc("texture2d", "rgba16f", *size, mips=full_mip_count(*size))


class FrameScene:
    """The scene of a frame, the same object while nothing moves; `steps.FrameScene` describes its properties.

    Attributes:
        scene: the scene of this frame.
        placed: the scene of the frame in which objects last moved.
    """

    def __init__(self, scene: Scene, before: FrameScene | None = None, decode: Decode | None = None) -> None:
        """Share unchanged values with the scene of the previous frames; `decode` is for `pixels`."""
        self.scene = self.placed = scene
        self.decode = decode
        if before is None or "corners" not in vars(before) or before.placed.meshes is not scene.meshes:
            return
        moved = changed_objects(before.placed, scene)
        self.corners = before.corners.copy()
        self.corners[moved] = corners_of(self.meshes, [self.objects[number] for number in moved])
        if all(_flags(before.placed.objects[number]) == _flags(self.objects[number]) for number in moved):
            self.shown, self.casting = before.shown, before.casting

    # `scene` is replaced even if no object moves, because lights may have changed.
    @property
    def lights(self) -> tuple[Light, ...]:
        return self.scene.lights

    @property
    def objects(self) -> tuple[Object, ...]:
        return self.scene.objects

    @property
    def materials(self) -> tuple[Material, ...]:
        return self.scene.materials

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        return self.scene.meshes

    @property
    def camera(self) -> Camera:
        assert self.scene.camera is not None  # `complete` has added one
        return self.scene.camera

    def pixels(self, image: ImageSource) -> npt.NDArray[np.float32]:
        assert self.decode is not None, "only a scene that is drawn has pixels"
        found = self.decode(image, False)
        return found.astype(np.float32) / np.float32(255 if found.dtype == np.uint8 else 1)

    @cached_property
    def corners(self) -> Corners:
        """World-space corners of the objects' boxes, (n, 8, 3), z fastest."""
        return corners_of(self.meshes, self.objects)

    @cached_property
    def shown(self) -> npt.NDArray[np.bool_]:
        return np.array([not entry.hidden for entry in self.objects], bool)

    @cached_property
    def casting(self) -> npt.NDArray[np.bool_]:
        return np.array([entry.casts_shadow and not entry.hidden for entry in self.objects], bool)

    @cached_property
    def catchers(self) -> npt.NDArray[np.int64]:
        numbers = self.scene.catchers
        return np.array([number for number in numbers if self.shown[number]], np.int64)

    @cached_property
    def bounds(self) -> tuple[Vec3, Vec3]:
        counts = self.shown
        if len(self.catchers):
            counts = counts.copy()
            counts[self.catchers] = False
        shown = self.corners if counts.all() else self.corners[counts]
        if not len(shown):
            return (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)
        (x, y, z), (u, v, w) = shown.min(axis=(0, 1)).tolist(), shown.max(axis=(0, 1)).tolist()
        return (x, y, z), (u, v, w)


def corners_of(meshes: tuple[Mesh, ...], objects: tuple[Object, ...] | list[Object]) -> Corners:
    transforms = np.array([entry.transform for entry in objects]).reshape(-1, 4, 4)
    low, high = boxes_of(meshes, objects)
    far = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], bool)
    local = np.where(far, high[:, None], low[:, None])
    placed: Corners = local @ transforms[:, :3, :3].swapaxes(1, 2) + transforms[:, None, :3, 3]
    return placed


def _flags(entry: Object) -> tuple[bool, bool]:
    return entry.hidden, entry.casts_shadow
