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
from rendergraph.scene import model
from rendergraph.scene.model import ImageSource, Matrix, Scene, bounds_of, changed_objects, corners_of
from rendergraph.textures import TextureDesc, full_mip_count

Decode: TypeAlias = Callable[[ImageSource, bool], npt.NDArray[Any]]
"""Image to (height, width, 4) uint8 or floats, top row first; the flag says that colours are sRGB."""


def selected(scene: Scene, name: str) -> list[int]:
    """Return the objects that a keyword of `SELECTIONS` names, without hidden ones."""
    takes, blended = SELECTIONS[name], [scene.is_blended(material) for material in scene.materials]
    objects = enumerate(scene.objects)
    return [number for number, one in objects if not one.hidden and takes(one.casts_shadow, blended[one.material])]


def object_facts(scene: Scene) -> tuple[ObjectFacts, ...]:
    facts = []
    traits = [
        (scene.is_blended(one), scene.has_grain(one), scene.emits(one), scene.reflects(one), scene.layers(one))
        for one in scene.materials
    ]
    for placed in scene.objects:
        mesh, material = scene.meshes[placed.mesh], scene.materials[placed.material]
        blended, grain, emissive, reflective, layers = traits[placed.material]
        counts = len(mesh.indices), len(mesh.positions)
        flags = placed.casts_shadow, blended, material.double_sided, placed.hidden, grain, emissive, reflective
        gap, plane, convex = (partial(attrgetter(name), mesh) for name in ("edges.gap", "plane", "convex"))
        facts.append(ObjectFacts(placed.name, *counts, *flags, mesh.name, gap, plane, convex, placed.extra, layers))
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
        self.placed, self.decode = scene, decode
        self.show(scene)
        if before is None or "corners" not in vars(before) or before.placed.meshes is not scene.meshes:
            return
        moved = changed_objects(before.placed, scene)
        self.corners = before.corners.copy()
        self.corners[moved] = corners_of(self.meshes, [self.objects[number] for number in moved])
        flags = attrgetter("hidden", "casts_shadow")
        if all(flags(before.placed.objects[number]) == flags(self.objects[number]) for number in moved):
            self.shown, self.casting = before.shown, before.casting

    def show(self, scene: Scene) -> None:
        """Take the scene of another frame in which no object moves; lights may have changed."""
        self.scene = scene
        self.lights, self.objects = scene.lights, scene.objects
        self.materials, self.meshes = scene.materials, scene.meshes

    @property
    def camera(self) -> model.Camera:
        assert self.scene.camera is not None  # `complete` has added one
        return self.scene.camera

    def pixels(self, image: ImageSource) -> npt.NDArray[np.float32]:
        assert self.decode is not None, "only a scene that is drawn has pixels"
        found = self.decode(image, False)
        return found.astype(np.float32) / np.float32(255 if found.dtype == np.uint8 else 1)

    @cached_property
    def corners(self) -> Matrix:
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
        return np.array([number for number in self.scene.catchers if self.shown[number]], np.int64)

    @cached_property
    def bounds(self) -> tuple[model.Vec3, model.Vec3]:
        counts = self.shown
        if len(self.catchers):
            counts = counts.copy()
            counts[self.catchers] = False
        return bounds_of(self.corners if counts.all() else self.corners[counts])
