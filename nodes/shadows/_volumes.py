"""What the nodes share that count shadow volumes in the stencil."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rendergraph.api import (
    Facts,
    Frame,
    Internal,
    ObjectFacts,
    Port,
    SceneError,
    State,
    Stencil,
    StencilFace,
    Steps,
    ViewMatrices,
    casting_lights,
    param,
    projection,
    structural,
)

from ._casting import Casting
from ._silhouettes import silhouette

Points = npt.NDArray[np.float64]
Z_PASS, Z_FAIL = 1, 2
_COUNTING = {
    Z_PASS: Stencil(StencilFace(depth_pass="incr_wrap"), StencilFace(depth_pass="decr_wrap")),
    Z_FAIL: Stencil(StencilFace(depth_fail="decr_wrap"), StencilFace(depth_fail="incr_wrap")),
}
IN_SHADOW = Stencil(StencilFace(func="notequal", depth_pass="zero"))
"""Lets through what is in a volume, and wipes the count."""
LIT = Stencil(StencilFace(func="equal"))
"""Lets through what is in none."""
WIPE = Stencil(StencilFace(depth_pass="zero"))
"""Wipes the count."""
_NAMES = {Z_PASS: "z-pass", Z_FAIL: "z-fail"}
AWAY = -16.0  # of depth, away from the eye: a lit face is not behind the volume that it is an end of


class HasVolumes(Casting):
    """Base of the nodes that make the shadow volumes of lights, wherever those are drawn to."""

    counting = Internal(
        kind="buffer", bytes=lambda node, facts: 4 * max(1, len(node.lights(facts)) * len(facts.objects))
    )

    length_of_sides: float = param(
        default=0.0,
        unit="m",
        min=0,
        max=1e6,
        doc="How far volumes reach; 0 is to infinity, or where light is parallel to one point.",
    )
    unclosed: Literal["refuse", "skip"] = structural(
        default="refuse", doc="A caster that is not closed is an error of `check`, or casts no shadow."
    )

    def casters(self, facts: Facts) -> tuple[ObjectFacts, ...]:
        """The objects that cast.

        Raises:
            SceneError: one of them is not closed.
        """
        casters = facts.drawn("casters")
        if self.unclosed == "skip":
            return tuple(one for one in casters if one.closed)
        for one in casters:
            if not one.closed:
                raise SceneError(f"{one.gap}; `casts_shadow: false` or `unclosed: skip` leaves it out", one.name)
        return casters

    def draw_volumes(self, steps: Steps, layer: int, way: int, geometry: str, **told: Any) -> None:
        """Casters by a geometry shader, those of one way to count; what else a step takes is `told`."""
        steps.geometry(
            vertex="shadow_volumes.vert",
            geometry=geometry,
            topology="triangles_adjacency",
            objects=[one.name for one in self.casters(steps.facts)],
            materials="none",
            counting=self.counting,
            first_way=layer * len(steps.facts.objects),
            defines=_told_by_macros(self.lights(steps.facts)[layer], way),
            **told,
        )

    def way(self, near: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
        """Which way objects are counted, by whether they may touch the near pyramid."""
        return np.full(len(near), Z_FAIL, np.int32)

    def ways(self, frame: Frame) -> tuple[list[Any], npt.NDArray[np.int32]]:
        """The lights that cast, and for each of them which way each object is counted: 0 where it cannot matter."""
        scene = frame.scene
        lights = [scene.lights[index] for index in casting_lights(self.light, scene.lights)]
        centers, radii = bounding_spheres(scene)
        found = np.zeros((len(lights), len(scene.objects)), np.int32)
        for layer, light in enumerate(lights):
            found[layer] = self.way(touches_near_pyramid(frame.camera, light_place(light), centers, radii))
            if light.range is not None and light.type != "directional":
                found[layer] *= np.linalg.norm(centers - light.position, axis=1) < radii + light.range
        return lights, found

    def update(self, frame: Frame) -> None:
        """Which casters each light has in reach."""
        frame.write(self.counting, self.ways(frame)[1])


class CountsVolumes(HasVolumes):
    """Base of the nodes that count, at every pixel, how many shadow volumes its surface lies in (Crow 1977).

    A volume is what a caster hides from a light: its sides stand on the silhouette, the edges between a face that the
    light meets and one that it does not. Where more of its faces are entered than left between the eye and the surface,
    the surface is in shadow. `zpass` counts the faces before the surface (Heidmann 1991), which fails where the near
    plane cuts a volume; `zfail` counts those behind it, and needs volumes with ends (Bilodeau and Songy 1999, Carmack
    2000). `auto` asks of each object whether it may touch the pyramid from the near plane's rectangle to the light, and
    takes `zfail` for those alone (Everitt and Kilgard 2002).
    """

    sides = Internal(kind="buffer", bytes=lambda node, facts: 48 * node.most_triangles(facts))  # 3 edges for 2 faces
    faces = Internal(kind="buffer", bytes=lambda node, facts: 48 * node.most_triangles(facts))
    commands = Internal(kind="buffer", bytes=lambda node, facts: 80 * max(1, len(node.lights(facts))))

    method: Literal["auto", "zpass", "zfail"] = structural(
        default="auto", doc="Count volumes before the surface, or behind it, or choose for each object."
    )
    silhouettes: Literal["gpu", "cpu"] = structural(
        default="gpu", doc="Found by a geometry shader, or each frame on the CPU, which sends less to the GPU."
    )
    depth_clamp: bool = structural(
        default=True, doc="Let volumes reach through a far plane that is not infinite; without it they are cut there."
    )

    def most_triangles(self, facts: Facts) -> int:
        """How many triangles may stand in silhouettes at once."""
        return max(1, len(self.lights(facts)) * sum(one.triangles for one in self.casters(facts)))

    def count(self, steps: Steps, layer: int, marks: Port, view: Port | None = None) -> None:
        """Leave in a stencil how many volumes of a light the surface lies in.

        Args:
            steps: what records it.
            layer: which of the lights that cast.
            marks: depth of the surfaces, as the pipeline's camera sees them, with a stencil of zeros.
            view: what carries the view they are seen with.
        """
        casters = self.casters(steps.facts)
        light = self.lights(steps.facts)[layer]
        ways = {"auto": (Z_PASS, Z_FAIL), "zpass": (Z_PASS,), "zfail": (Z_FAIL,)}[self.method]
        for way in ways if casters else ():
            state = State(
                depth_func="greater",
                depth_write=False,
                depth_clamp=self.depth_clamp,
                polygon_offset=(0.0, AWAY),
                cull="none",
                front="counter_clockwise",
                stencil=_COUNTING[way],
            )
            told: dict[str, Any] = {
                "out": marks,
                "view": view,
                "region": layer,
                "state": state,
                "label": f"{steps.lights[light].name}, {_NAMES[way]}",
            }
            if self.silhouettes == "gpu":
                self.draw_volumes(steps, layer, way, "shadow_volumes.geom", fragment=None, **told)
                continue
            command = 4 * layer + 2 * (way == Z_FAIL)
            told |= {"vertices": self.commands, "defines": _told_by_macros(light, way)}
            steps.draw(None, vertex="silhouette_sides.vert", sides=self.sides, command=command, **told)
            steps.draw(None, vertex="silhouette_ends.vert", faces=self.faces, command=command + 1, **told)

    def way(self, near: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
        """Which way objects are counted."""
        return np.where(near if self.method == "auto" else self.method == "zfail", Z_FAIL, Z_PASS)

    def update(self, frame: Frame) -> None:
        """Which way each object's volume is counted, and where in the picture a light of limited range reaches."""
        lights, ways = self.ways(frame)
        for layer, light in enumerate(lights):
            if light.range is not None and light.type != "directional":
                frame.set_region(layer, *projection.sphere_bounds(frame.camera, light.position, light.range))
            else:
                frame.set_region(layer)
        if self.silhouettes == "gpu":
            frame.write(self.counting, ways)
        else:
            self._find_silhouettes(frame, lights, ways)

    def _find_silhouettes(self, frame: Frame, lights: list[Any], ways: npt.NDArray[np.int32]) -> None:
        """What the draws of all lights are made of, behind each other, and which part each of them draws."""
        scene = frame.scene
        casting = [number for number, entry in enumerate(scene.objects) if self._casts(scene, entry)]
        sides, faces = [np.zeros((0, 4), np.float32)], [np.zeros((0, 4), np.float32)]
        commands = np.zeros((4 * len(lights), 5), np.int32)
        at = [0, 0]
        for number in range(2 * len(lights)):
            layer, way = number // 2, (Z_PASS, Z_FAIL)[number % 2]
            for index in casting:
                if ways[layer, index] == way:
                    entry = scene.objects[index]
                    found = silhouette(scene.meshes[entry.mesh], entry.transform, light_place(lights[layer]))
                    sides.append(_four(found.sides))
                    if way == Z_FAIL or self.length_of_sides > 0:
                        faces.append(_four(found.lit))
            ends = sum(map(len, sides)) // 2, sum(map(len, faces)) // 3
            for kind in (0, 1):
                commands[2 * number + kind, :3] = 6 * (ends[kind] - at[kind]), 1, 6 * at[kind]
            at = list(ends)
        frame.write(self.sides, np.concatenate(sides))
        frame.write(self.faces, np.concatenate(faces))
        frame.write(self.commands, commands)

    def _casts(self, scene: Any, entry: Any) -> bool:
        """Whether an object is one of the `casters`."""
        seen = entry.casts_shadow and not entry.hidden and scene.materials[entry.material].alpha_mode != "blend"
        return seen and not scene.meshes[entry.mesh].edges.gap


def _four(points: Points) -> npt.NDArray[np.float32]:
    """Points as the shaders' vec4."""
    found = np.ones((points.size // 3, 4), np.float32)
    found[:, :3] = points.reshape(-1, 3)
    return found


def _told_by_macros(light: int, way: int) -> dict[str, int]:
    return {"LIGHT": light, "COUNTED": way, "Z_PASS": Z_PASS, "Z_FAIL": Z_FAIL}


def light_place(light: Any) -> Points:
    """A light as a homogeneous point, shape (4,): its position, or with w = 0 the direction to it."""
    if light.type == "directional":
        return np.array([*(-np.asarray(light.direction, np.float64)), 0.0])
    return np.array([*light.position, 1.0])


def bounding_spheres(scene: Any) -> tuple[Points, Points]:
    """Centres (n, 3) and radii (n,) of balls around the scene's objects, world space."""
    boxes = np.array([mesh.box for mesh in scene.meshes], np.float64).reshape(-1, 2, 3)
    placed = boxes[[entry.mesh for entry in scene.objects]]
    transforms = np.array([entry.transform for entry in scene.objects]).reshape(-1, 4, 4)
    middle, half = placed.mean(axis=1), np.ptp(placed, axis=1) / 2
    centers = np.einsum("nij,nj->ni", transforms[:, :3, :3], middle) + transforms[:, :3, 3]
    return centers, np.linalg.norm(np.einsum("nij,nj->ni", np.abs(transforms[:, :3, :3]), half), axis=1)


def touches_near_pyramid(camera: ViewMatrices, light: Points, centers: Points, radii: Points) -> npt.NDArray[np.bool_]:
    """Which balls may touch the pyramid from the near plane's rectangle to a light (Lengyel 2002).

    What casts a shadow onto the near plane lies in there; of everything else z-pass counts right.

    Args:
        camera: whose near plane it is.
        light: its place, homogeneous.
        centers, radii: of the balls.
    """
    corners = projection.frustum_corners(camera, far=2 * max(camera.near, 1e-6))[[0, 1, 3, 2]]
    middle = corners.mean(axis=0)
    across = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    to_light = light[:3] - light[3] * middle
    if abs(across @ to_light) <= 1e-9 * np.linalg.norm(across) * np.linalg.norm(to_light):
        return np.ones(len(centers), bool)  # the light lies in the near plane: there is no pyramid
    touched = np.ones(len(centers), bool)
    normals = [across * np.sign(across @ to_light)]
    for start, stop in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.cross(stop - start, light[:3] - light[3] * start)
        normals.append(normal * np.sign(normal @ (middle - start)))
    for normal, through in zip(normals, corners[[0, 0, 1, 2, 3]], strict=True):
        touched &= (centers - through) @ normal > -radii * np.linalg.norm(normal)
    return touched
